//! Tables for the terminal.

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

/// A row of a table, of anything that can be displayed.
macro_rules! row {
    ($($cell:expr),* $(,)?) => { vec![$($cell.to_string()),*] };
}
pub(crate) use row;

/// Rows under a heading. Columns of numbers are aligned on the right, others and the first one on the left.
pub(crate) fn table(head: &[impl AsRef<str>], rows: &[Vec<String>]) -> String {
    let head: Vec<String> = head.iter().map(|cell| cell.as_ref().to_owned()).collect();
    let lines = || [&head].into_iter().chain(rows);
    let width = |column: usize| lines().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let is_numeric = |column: usize| column > 0 && rows.iter().all(|row| looks_numeric(&row[column]));
    let columns: Vec<(usize, bool)> = (0..head.len()).map(|i| (width(i), is_numeric(i))).collect();
    let mut text = String::new();
    for line in lines() {
        let cells = line.iter().zip(&columns).map(|(cell, &(width, is_numeric))| match is_numeric {
            true => format!("{cell:>width$}"),
            false => format!("{cell:<width$}"),
        });
        let cells: Vec<String> = cells.collect();
        text += cells.join("  ").trim_end();
        text.push('\n');
    }
    text
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
        let owned = |row: &[&str]| row.iter().map(|c| (*c).to_owned()).collect::<Vec<_>>();
        let text = table(&["raw", "ε [mm]"], &[owned(&["a long name", "1"]), owned(&["b", "12345678"])]);
        assert_eq!(text, "raw            ε [mm]\na long name         1\nb            12345678\n");
        let text = table(&["case", "mm", "ends"], &[owned(&["a", "–", "kept"]), owned(&["b", "-1.5", ""])]);
        assert_eq!(text, "case    mm  ends\na        –  kept\nb     -1.5\n");
    }
}
