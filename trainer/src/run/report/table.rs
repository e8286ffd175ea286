//! A table of JSON values, written as Markdown and as HTML.

use super::html::{escape, paragraph};
use crate::picture::chart::axis::number_text;
use serde::Serialize;
use serde_json::Value;

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

/// A column: its heading, the JSON pointer of its value in a row, and how the value is written.
pub type Column<'a> = (&'a str, &'a str, fn(&Value) -> String);

impl Table {
    /// A view of `rows`; a value that a row lacks is null.
    pub fn new(title: impl Into<String>, rows: &[Value], columns: &[Column<'_>]) -> Self {
        let cell =
            |row: &Value, (_, pointer, text): &Column<'_>| text(row.pointer(pointer).unwrap_or(&Value::Null));
        Self {
            title: title.into(),
            note: String::new(),
            head: columns.iter().map(|(heading, ..)| (*heading).to_owned()).collect(),
            rows: rows.iter().map(|row| columns.iter().map(|column| cell(row, column)).collect()).collect(),
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

    /// With rows and columns exchanged.
    pub fn transposed(self) -> Self {
        let lines: Vec<Vec<String>> = [self.head].into_iter().chain(self.rows).collect();
        let column = |i: usize| lines.iter().map(|line| line[i].clone()).collect();
        let rows = (1..lines[0].len()).map(column).collect();
        Self { head: column(0), rows, ..self }
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
        format!(
            "<table><caption>{}{}</caption><tr>{}</tr>\n{rows}</table>\n",
            escape(&self.title),
            paragraph(&self.note),
            cells("th", &self.head)
        )
    }
}

/// As it is: a name, a count, yes or no.
pub fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Bool(is_so) => if *is_so { "yes" } else { "no" }.to_owned(),
        Value::Null => String::new(),
        _ => value.to_string(),
    }
}

/// Three significant digits; what is not finite by its name.
pub fn number(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        _ => value.as_f64().map_or("–".to_owned(), |value| number_text(value, 3)),
    }
}

/// A share in percent.
pub fn percent(share: &Value) -> String {
    share.as_f64().map_or("–".to_owned(), |share| number_text(100.0 * share, 3))
}

/// Mean (median) of an estimate.
pub fn mean_and_median(estimate: &Value) -> String {
    format!("{} ({})", number(&estimate["mean"]), number(&estimate["median"]))
}

/// The same of shares in percent.
pub fn percent_and_median(estimate: &Value) -> String {
    format!("{} ({})", percent(&estimate["mean"]), percent(&estimate["median"]))
}

/// Median (95th percentile) of a spread.
pub fn median_and_p95(spread: &Value) -> String {
    format!("{} ({})", number(&spread["median"]), number(&spread["p95"]))
}

/// Mean of an estimate (95 % interval of the mean).
pub fn mean_with_interval(estimate: &Value) -> String {
    with_interval(estimate, "mean", number)
}

/// The same of shares in percent.
pub fn percent_with_interval(estimate: &Value) -> String {
    with_interval(estimate, "mean", percent)
}

/// Median of an estimate (95 % interval of the mean).
pub fn median_with_interval(estimate: &Value) -> String {
    with_interval(estimate, "median", number)
}

/// Ratio of means (95 % interval).
pub fn ratio_with_interval(ratio: &Value) -> String {
    with_interval(ratio, "of_means", number)
}

fn with_interval(value: &Value, middle: &str, text: fn(&Value) -> String) -> String {
    match value {
        Value::Null => "–".to_owned(),
        _ => {
            let [low, high] = [0, 1].map(|end| text(&value["interval"][end]));
            format!("{} [{low}, {high}]", text(&value[middle]))
        }
    }
}

/// Count of all of a proportion (95 % interval in percent, without decimals).
pub fn proportion(value: &Value) -> String {
    let end = |i: usize| 100.0 * value["interval"][i].as_f64().unwrap_or(f64::NAN);
    match value {
        Value::Null => "–".to_owned(),
        _ => format!("{} of {} [{:.0}, {:.0}]", value["count"], value["of"], end(0), end(1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn both_forms_hold_every_cell_and_no_markup_of_the_data() {
        let rows = [json!({ "name": "a|b <i>", "depth": { "mean": 1.5 } })];
        let columns: [Column<'_>; 2] = [("name", "/name", plain), ("mm", "/depth/mean", number)];
        let table = Table::new("A <title>", &rows, &columns).with_note("a note");
        let (markdown, html) = (table.markdown(), table.html());
        assert!(markdown.contains("| a\\|b <i> | 1.5 |") && markdown.contains("|---|---:|"), "{markdown}");
        assert!(
            html.contains("a|b &lt;i&gt;") && html.contains("A &lt;title&gt;") && !html.contains("<i>"),
            "{html}"
        );
        let transposed = table.transposed();
        assert_eq!(
            (transposed.head, transposed.rows),
            (vec!["name".into(), "a|b <i>".into()], vec![vec!["mm".into(), "1.5".into()]])
        );
    }
}
