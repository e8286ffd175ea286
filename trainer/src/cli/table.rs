//! Tables for the terminal and for Markdown.

/// A row of a table: headings with the cells below them.
pub(crate) type Row = Vec<(String, String)>;

/// A [`Row`] from `heading => value` pairs.
macro_rules! row {
    ($($heading:expr => $value:expr),* $(,)?) => {
        vec![$(($heading.to_string(), $crate::cli::table::Cell::text(&$value))),*]
    };
}
pub(crate) use row;

/// A value that a table can show.
pub(crate) trait Cell {
    /// The text of the cell.
    fn text(&self) -> String;
}

macro_rules! cell_as_displayed {
    ($($kind:ty),*) => {
        $(impl Cell for $kind {
            fn text(&self) -> String {
                self.to_string()
            }
        })*
    };
}
cell_as_displayed!(str, String, usize, u64);

impl Cell for f64 {
    fn text(&self) -> String {
        number(*self)
    }
}

impl Cell for bool {
    fn text(&self) -> String {
        if *self { "yes" } else { "no" }.to_owned()
    }
}

impl<T: Cell> Cell for Option<T> {
    fn text(&self) -> String {
        self.as_ref().map_or_else(|| "–".to_owned(), Cell::text)
    }
}

impl<T: Cell + ?Sized> Cell for &T {
    fn text(&self) -> String {
        (*self).text()
    }
}

/// Four significant digits.
pub(crate) fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e5).contains(&size) => {
            let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.3e}"),
    }
}

/// The headings of the first of `rows`, and the cells of all below them. Columns of numbers are aligned on the right, others and
/// the first one on the left. No rows make no table.
pub(crate) fn table(rows: &[Row]) -> String {
    let lines = lines(rows);
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let is_numeric = |column: usize| column > 0 && lines[1..].iter().all(|line| looks_numeric(line[column]));
    let columns: Vec<(usize, bool)> =
        (0..lines.first().map_or(0, Vec::len)).map(|i| (width(i), is_numeric(i))).collect();
    let mut text = String::new();
    for line in &lines {
        let cells = line.iter().zip(&columns).map(|(cell, &(width, is_numeric))| match is_numeric {
            true => format!("{cell:>width$}"),
            false => format!("{cell:<width$}"),
        });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    text
}

/// The same in Markdown.
pub(crate) fn markdown(rows: &[Row]) -> String {
    let mut lines: Vec<String> =
        lines(rows).iter().map(|cells| format!("| {} |\n", cells.join(" | "))).collect();
    let columns = rows.first().map_or(0, Vec::len);
    lines.insert(1.min(lines.len()), format!("|---|{}\n", "---:|".repeat(columns.saturating_sub(1))));
    lines.concat()
}

/// Headings and cells.
fn lines(rows: &[Row]) -> Vec<Vec<&str>> {
    let head = rows.first().map(|row| row.iter().map(|(heading, _)| heading.as_str()).collect());
    let cells = rows.iter().map(|row| row.iter().map(|(_, cell)| cell.as_str()).collect());
    head.into_iter().chain(cells).collect()
}

/// Whether a cell holds a number, nothing, or the dash of a missing number.
fn looks_numeric(cell: &str) -> bool {
    let unsigned = cell.trim_start_matches(['+', '-', '–', '(']);
    unsigned.is_empty() || unsigned.starts_with(|c: char| c.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_four_digits() {
        for (value, text) in [
            (0.0, "0"),
            (-0.46312, "-0.4631"),
            (12345.6, "12346"),
            (2.17749, "2.177"),
            (1.5e-9, "1.500e-9"),
            (0.001, "0.001000"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn columns_are_aligned() {
        let rows =
            [row!["raw" => "a long name", "ε [mm]" => 1_usize], row!["raw" => "b", "ε [mm]" => "12345678"]];
        assert_eq!(table(&rows), "raw            ε [mm]\na long name         1\nb            12345678\n");
        let row = |mm: Option<f64>, end: &str| row!["case" => "a", "mm" => mm, "end" => end];
        let rows = [row(None, "kept"), row(Some(-1.5), "")];
        assert_eq!(table(&rows), "case      mm  end\na          –  kept\na     -1.500\n");
        assert_eq!(
            markdown(&rows),
            "| case | mm | end |\n|---|---:|---:|\n| a | – | kept |\n| a | -1.500 |  |\n"
        );
        assert_eq!(table(&[]), "");
    }
}
