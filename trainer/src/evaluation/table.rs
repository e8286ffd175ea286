//! A table that is written as Markdown and as HTML.

use super::{Estimate, Proportion, Ratio};
use crate::picture::axis::number_text;
use crate::run::report::html::escape;
use serde::Serialize;

/// Rows under a heading.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Table {
    /// What it shows; scenes and units.
    pub title: String,
    /// What a reader has to know to read it; may be empty.
    pub note: String,
    /// Headings of the columns.
    pub head: Vec<String>,
    /// The cells, as text.
    pub rows: Vec<Vec<String>>,
}

/// A column: its heading, and the cell of a row.
pub type Column<'a, R> = (&'a str, &'a dyn Fn(&R) -> String);

impl Table {
    /// A row for each of `rows`.
    pub fn new<R>(title: impl Into<String>, rows: &[R], columns: &[Column<'_, R>]) -> Self {
        let cells = |row: &R| columns.iter().map(|(_, cell)| cell(row)).collect();
        Self {
            title: title.into(),
            note: String::new(),
            head: columns.iter().map(|(heading, _)| (*heading).to_owned()).collect(),
            rows: rows.iter().map(cells).collect(),
        }
    }

    /// With a note under its title.
    pub fn with_note(self, note: impl Into<String>) -> Self {
        Self { note: note.into(), ..self }
    }

    /// With a further row; cells that it lacks are empty.
    pub fn with_row<C: Into<String>>(mut self, cells: impl IntoIterator<Item = C>) -> Self {
        let mut row: Vec<String> = cells.into_iter().map(C::into).collect();
        row.resize(self.head.len(), String::new());
        self.rows.push(row);
        self
    }

    /// Adds a column to the right of the others.
    pub fn add_column(&mut self, heading: &str, cells: impl Iterator<Item = String>) {
        self.head.push(heading.to_owned());
        self.rows.iter_mut().zip(cells).for_each(|(row, cell)| row.push(cell));
    }

    /// As Markdown: a bold title, the note, the table.
    pub fn markdown(&self) -> String {
        let safe = |text: &String| text.replace('|', "\\|");
        let line =
            |cells: &[String]| format!("| {} |\n", cells.iter().map(safe).collect::<Vec<_>>().join(" | "));
        let mut text = format!("**{}**\n\n", self.title);
        if !self.note.is_empty() {
            text += &format!("{}\n\n", self.note);
        }
        text += &line(&self.head);
        text += &format!("|---|{}\n", "---:|".repeat(self.head.len().saturating_sub(1)));
        self.rows.iter().for_each(|row| text += &line(row));
        text
    }

    /// As HTML.
    pub fn html(&self) -> String {
        let cells = |tag: &str, row: &[String]| -> String {
            row.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect()
        };
        let rows: String = self.rows.iter().map(|row| format!("<tr>{}</tr>\n", cells("td", row))).collect();
        let note =
            if self.note.is_empty() { String::new() } else { format!("<p>{}</p>", escape(&self.note)) };
        format!(
            "<table><caption>{}{note}</caption><tr>{}</tr>\n{rows}</table>\n",
            escape(&self.title),
            cells("th", &self.head)
        )
    }
}

/// Mean [95 % interval of the mean].
pub fn mean_with_interval(e: &Estimate) -> String {
    with_interval(e.spread.mean, e.interval, number)
}

/// Median [95 % interval of the mean].
pub fn median_with_interval(e: &Estimate) -> String {
    with_interval(e.spread.median, e.interval, number)
}

/// Mean of shares in percent [95 % interval of the mean].
pub fn percent_with_interval(e: &Estimate) -> String {
    with_interval(e.spread.mean, e.interval, percent)
}

/// Ratio of means [95 % interval].
pub fn ratio_with_interval(r: &Ratio) -> String {
    with_interval(r.of_means, r.interval, number)
}

fn with_interval(value: f64, [low, high]: [f64; 2], text: fn(f64) -> String) -> String {
    format!("{} [{}, {}]", text(value), text(low), text(high))
}

/// Mean (median).
pub fn mean_and_median(e: &Estimate) -> String {
    format!("{} ({})", number(e.spread.mean), number(e.spread.median))
}

/// Mean (median) of shares in percent.
pub fn percent_and_median(e: &Estimate) -> String {
    format!("{} ({})", percent(e.spread.mean), percent(e.spread.median))
}

/// Count of all [95 % interval in percent, without decimals].
pub fn share_text(share: &Proportion) -> String {
    let [low, high] = share.interval.map(|end| 100.0 * end);
    format!("{} of {} [{low:.0}, {high:.0}]", share.count, share.of)
}

/// Three significant digits.
pub fn number(value: f64) -> String {
    if value.is_nan() { "–".to_owned() } else { number_text(value, 3) }
}

/// A share in percent.
pub fn percent(share: f64) -> String {
    number(100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_every_cell_and_no_markup_of_the_data() {
        let table = Table::new(
            "A <title>",
            &["a|b <i>"],
            &[("name", &|name| (*name).into()), ("mm", &|_| number(1.5))],
        )
        .with_note("a note");
        let (markdown, html) = (table.markdown(), table.html());
        assert!(markdown.contains("| a\\|b <i> | 1.5 |") && markdown.contains("|---|---:|"), "{markdown}");
        assert!(
            html.contains("a|b &lt;i&gt;") && html.contains("A &lt;title&gt;") && !html.contains("<i>"),
            "{html}"
        );
    }
}
