//! A table that is written as Markdown and as HTML.

use super::estimate::{Estimate, Proportion, Ratio};
use crate::picture::chart::axis::number_text;
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

impl Table {
    /// An empty table.
    pub fn new(title: impl Into<String>, head: &[&str]) -> Self {
        let head = head.iter().map(|h| (*h).to_owned()).collect();
        Self { title: title.into(), note: String::new(), head, rows: Vec::new() }
    }

    /// With a note under its title.
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
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
    format!("{} [{}, {}]", number(e.spread.mean), number(e.interval[0]), number(e.interval[1]))
}

/// Mean (median).
pub fn mean_and_median(e: &Estimate) -> String {
    format!("{} ({})", number(e.spread.mean), number(e.spread.median))
}

/// Ratio of means [95 % interval].
pub fn ratio_with_interval(r: &Ratio) -> String {
    format!("{} [{}, {}]", number(r.of_means), number(r.interval[0]), number(r.interval[1]))
}

/// Mean of shares in percent [95 % interval of the mean].
pub fn percent_with_interval(e: &Estimate) -> String {
    format!("{} [{}, {}]", percent(e.spread.mean), percent(e.interval[0]), percent(e.interval[1]))
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
    if share.is_nan() { "–".to_owned() } else { number_text(100.0 * share, 3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_every_cell_and_no_markup_of_the_data() {
        let mut table = Table::new("A <title>", &["name", "mm"]).with_note("a note");
        table.rows.push(vec!["a|b <i>".into(), number(1.5)]);
        let (markdown, html) = (table.markdown(), table.html());
        assert!(markdown.contains("| a\\|b <i> | 1.5 |") && markdown.contains("|---|---:|"), "{markdown}");
        assert!(
            html.contains("a|b &lt;i&gt;") && html.contains("A &lt;title&gt;") && !html.contains("<i>"),
            "{html}"
        );
    }
}
