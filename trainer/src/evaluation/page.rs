//! The report as Markdown with pictures beside it, and as one HTML page that needs nothing but itself.

use crate::run::report::html::{escape, figure, image, page, paragraph};
use crate::run::report::table::Table;
use serde_json::Value;

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
pub struct EvaluationPage {
    /// Heading.
    pub title: String,
    /// What was measured, and the command that does it again.
    pub facts: Vec<(&'static str, String)>,
    /// The parts.
    pub sections: Vec<Section>,
}

impl EvaluationPage {
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
        let fact = |(name, value): &(&str, String)| paragraph(&format!("{name}: {value}"));
        let facts: String = self.facts.iter().map(fact).collect();
        let section = |section: &Section| {
            let tables: String = section.tables.iter().map(Table::html).collect();
            let picture = |Picture { caption, png, html, .. }: &Picture| {
                figure(caption, &html.clone().unwrap_or_else(|| image(caption, png)))
            };
            let pictures: String = section.pictures.iter().map(picture).collect();
            let (title, text) = (escape(section.title), paragraph(&section.text));
            format!("<section><h2>{title}</h2>{text}{tables}{pictures}</section>\n")
        };
        let sections: String = self.sections.iter().map(section).collect();
        let body = format!("<header><h1>{}</h1>{facts}</header>\n{sections}", escape(&self.title));
        page(&self.title, "", &body)
    }
}
