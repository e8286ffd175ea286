//! Text of the pages.

pub(crate) use crate::picture::svg::escape;

use crate::picture::svg;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

const PAGE_STYLE: &str = include_str!("report.css");

/// A page that needs nothing but itself; `head` and `body` are elements.
pub fn page(title: &str, head: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">{head}<title>{}</title>\
         <style>{}{PAGE_STYLE}</style></head>\n<body>{body}</body></html>\n",
        escape(title),
        svg::STYLE
    )
}

/// Elements under a caption.
pub fn figure(caption: &str, elements: &str) -> String {
    format!("<figure class=\"sample\"><figcaption>{}</figcaption>{elements}</figure>\n", escape(caption))
}

/// A PNG picture.
pub fn image(caption: &str, png: &[u8]) -> String {
    format!("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", escape(caption), STANDARD.encode(png))
}

/// A paragraph; none of no text.
pub fn paragraph(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!("<p>{}</p>", escape(text)) }
}

/// Seconds since 1970 as `2026-11-21 18:45 UTC`.
pub fn utc(seconds: u64) -> String {
    // Howard Hinnant's civil_from_days, for days from 1970 on.
    let days = (seconds / 86_400) as i64 + 719_468;
    let era = days / 146_097;
    let of_era = days % 146_097;
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let day_of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    let (hour, minute) = (seconds / 3600 % 24, seconds / 60 % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_dates() {
        assert_eq!(utc(0), "1970-01-01 00:00 UTC");
        assert_eq!(utc(951_826_500), "2000-02-29 12:15 UTC");
        assert_eq!(utc(1_767_225_599), "2025-12-31 23:59 UTC");
    }
}
