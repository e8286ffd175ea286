//! The report as Markdown with pictures beside it, and as one HTML page that needs nothing but itself.

use super::table::Table;
use crate::picture::svg;
use crate::run::report::html::escape;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

const STYLE: &str = include_str!("../run/report/report.css");

/// A part of the report.
pub struct Section {
    /// Its name in `eval.json`.
    pub key: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// What a reader has to know; may be empty.
    text: String,
    /// Its numbers: what the tables show, and more.
    pub numbers: Value,
    /// Views of the numbers.
    pub tables: Vec<Table>,
    /// Pictures.
    pub pictures: Vec<Picture>,
}

impl Section {
    /// Without pictures.
    pub fn new(
        key: &'static str,
        title: &'static str,
        text: &str,
        numbers: impl Into<Value>,
        tables: Vec<Table>,
    ) -> Self {
        Self { key, title, text: text.to_owned(), numbers: numbers.into(), tables, pictures: Vec::new() }
    }
}

/// A picture of the report.
pub struct Picture {
    /// Name of its file.
    pub file: String,
    /// One sentence.
    pub caption: String,
    /// The file.
    pub png: Vec<u8>,
    /// The same as elements of the page, where it is charts.
    pub html: Option<String>,
}

/// Everything, to be read.
pub struct Page {
    /// Heading.
    pub title: String,
    /// What was measured, and the command that does it again.
    pub facts: Vec<(&'static str, String)>,
    /// The parts.
    pub sections: Vec<Section>,
}

impl Page {
    /// As Markdown; pictures are files beside it.
    pub fn markdown(&self) -> String {
        let mut text = format!("# {}\n\n", self.title);
        for (name, value) in &self.facts {
            text += &format!("- {name}: {value}\n");
        }
        for section in &self.sections {
            text += &format!("\n## {}\n\n", section.title);
            if !section.text.is_empty() {
                text += &format!("{}\n\n", section.text);
            }
            let parts = section.tables.iter().map(Table::markdown);
            let picture =
                |Picture { file, caption, .. }: &Picture| format!("![{caption}]({file})\n\n{caption}\n");
            let pictures = section.pictures.iter().map(picture);
            text += &parts.chain(pictures).collect::<Vec<_>>().join("\n");
        }
        text
    }

    /// As one page of HTML.
    pub fn html(&self) -> String {
        let facts: String = self
            .facts
            .iter()
            .map(|(name, value)| format!("<p>{}: {}</p>", escape(name), escape(value)))
            .collect();
        let section = |section: &Section| {
            let tables: String = section.tables.iter().map(Table::html).collect();
            let picture = |picture: &Picture| {
                let caption = escape(&picture.caption);
                let shown = picture.html.clone().unwrap_or_else(|| {
                    let png = STANDARD.encode(&picture.png);
                    format!("<img alt=\"{caption}\" src=\"data:image/png;base64,{png}\">")
                });
                format!("<figure class=\"sample\"><figcaption>{caption}</figcaption>{shown}</figure>\n")
            };
            let pictures: String = section.pictures.iter().map(picture).collect();
            let text = if section.text.is_empty() {
                String::new()
            } else {
                format!("<p>{}</p>", escape(&section.text))
            };
            format!("<section><h2>{}</h2>{text}{tables}{pictures}</section>\n", escape(section.title))
        };
        let sections: String = self.sections.iter().map(section).collect();
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{title}</title><style>{}{STYLE}</style></head>\n\
             <body><header><h1>{title}</h1>{facts}</header>\n{sections}</body></html>\n",
            svg::STYLE,
            title = escape(&self.title)
        )
    }
}
