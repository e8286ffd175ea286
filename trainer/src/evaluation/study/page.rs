//! The report as Markdown with pictures beside it, and as one HTML page that needs nothing but itself.

use super::table::Table;
use crate::picture::svg;
use crate::run::report::html::escape;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

const STYLE: &str = include_str!("../../run/report/report.css");

/// A part of the report.
#[derive(Default)]
pub struct Section {
    /// Its heading.
    pub title: String,
    /// A sentence on what is asked; may be empty.
    pub text: String,
    /// Tables.
    pub tables: Vec<Table>,
    /// Charts and pictures.
    pub figures: Vec<Figure>,
}

/// A picture beside the Markdown, and inside the page.
pub struct Figure {
    /// Name of its file.
    pub file: String,
    /// One sentence.
    pub caption: String,
    /// The file.
    pub png: Vec<u8>,
    /// The same as an element of the page, where it is a chart.
    pub svg: Option<String>,
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
            let figures = section
                .figures
                .iter()
                .map(|Figure { file, caption, .. }| format!("![{caption}]({file})\n\n{caption}\n"));
            text += &parts.chain(figures).collect::<Vec<_>>().join("\n");
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
            let figure = |figure: &Figure| {
                let caption = escape(&figure.caption);
                let shown = figure.svg.clone().unwrap_or_else(|| {
                    let png = STANDARD.encode(&figure.png);
                    format!("<img alt=\"{caption}\" src=\"data:image/png;base64,{png}\">")
                });
                format!("<figure class=\"sample\"><figcaption>{caption}</figcaption>{shown}</figure>\n")
            };
            let figures: String = section.figures.iter().map(figure).collect();
            let text = if section.text.is_empty() {
                String::new()
            } else {
                format!("<p>{}</p>", escape(&section.text))
            };
            format!("<section><h2>{}</h2>{text}{tables}{figures}</section>\n", escape(&section.title))
        };
        let sections: String = self.sections.iter().map(section).collect();
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width\"><title>{title}</title><style>{STYLE}{}</style></head>\n\
             <body><header><h1>{title}</h1>{facts}</header>\n{sections}</body></html>\n",
            svg::STYLE,
            title = escape(&self.title)
        )
    }
}
