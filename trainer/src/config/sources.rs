//! The texts that a configuration is made of, its own and those it extends, as one tree in which every value knows its place.

use super::error::ConfigError;
use super::reworded::reworded;
use miette::{NamedSource, SourceSpan};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Key that names the configuration another one starts from: tables are merged, everything else replaces.
pub(super) const EXTENDS: &str = "extends";
/// Longer chains of configurations are taken for a circle.
const LONGEST_CHAIN: usize = 8;

/// A chain of configurations, the extending one first. Places count bytes over all texts, one after the other.
pub(super) struct Sources(Vec<SourceText>);

struct SourceText {
    path: PathBuf,
    /// As many line ends as the texts before have bytes, so that the parser counts on from them; then the text.
    padded: String,
    start: usize,
}

/// A place in one of the texts.
pub(super) struct Place {
    pub source_code: Arc<NamedSource<String>>,
    pub span: Option<SourceSpan>,
}

impl Sources {
    /// `text`, read from `path`, and what it extends.
    pub fn read(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let mut sources = Self(Vec::new());
        let mut next = Some((path.to_owned(), text.to_owned()));
        while let Some((path, text)) = next {
            let start = sources.0.last().map_or(0, |source| source.padded.len() + 1);
            sources.0.push(SourceText { padded: "\n".repeat(start) + &text, path, start });
            next = sources.base()?;
        }
        Ok(sources)
    }

    /// Path and text of what the last one extends.
    fn base(&self) -> Result<Option<(PathBuf, String)>, ConfigError> {
        let Some(last) = self.0.last() else { return Ok(None) };
        let table = self.parsed(last)?;
        let Some(value) = table.get_ref().get(EXTENDS) else { return Ok(None) };
        let bad = |reason: String| {
            let Place { source_code, span } = self.place(Some(value.span()));
            ConfigError::BadBase { reason, source_code, span }
        };
        let DeValue::String(name) = value.get_ref() else {
            return Err(bad(format!("{EXTENDS} is not the name of a file")));
        };
        if self.0.len() > LONGEST_CHAIN {
            return Err(bad(format!(
                "extends {name}, the last of {LONGEST_CHAIN} in a row: do they extend each other?"
            )));
        }
        let file = last.path.parent().unwrap_or(Path::new("")).join(name.as_ref());
        match std::fs::read_to_string(&file) {
            Ok(text) => Ok(Some((file, text))),
            Err(error) => Err(bad(format!("extends {}: {error}", file.display()))),
        }
    }

    fn parsed<'a>(&self, source: &'a SourceText) -> Result<Spanned<DeTable<'a>>, ConfigError> {
        DeTable::parse(&source.padded).map_err(|error| self.invalid(&error))
    }

    /// All of them merged.
    pub fn tree(&self) -> Result<Spanned<DeTable<'_>>, ConfigError> {
        let mut whole = DeTable::new();
        let mut span = 0..0;
        for source in self.0.iter().rev() {
            let mut own = self.parsed(source)?;
            own.get_mut().remove(EXTENDS);
            span = own.span();
            merge(&mut whole, own.into_inner());
        }
        Ok(Spanned::new(span, whole))
    }

    /// What is wrong with a text, with its place.
    pub fn invalid(&self, error: &toml::de::Error) -> ConfigError {
        let Place { source_code, span } = self.place(error.span());
        ConfigError::Invalid { message: reworded(error.message()), source_code, span }
    }

    /// Where the value `key` (for example `stages[0].layers`) stands, or the innermost section of it that is there; the
    /// extending configuration as a whole, if none is.
    pub fn place_of(&self, key: &str) -> Place {
        self.place(self.span_of(key))
    }

    fn span_of(&self, key: &str) -> Option<Range<usize>> {
        let tree = self.tree().ok();
        let mut found = None;
        let mut node = tree.as_ref().map(Spanned::get_ref).map(TomlNode::Table);
        for part in key.split(['.', '[']) {
            let value = match (node, part.strip_suffix(']').map(str::parse::<usize>)) {
                (Some(TomlNode::Table(table)), None) => table.get(part),
                (Some(TomlNode::Value(DeValue::Table(table))), None) => table.get(part),
                (Some(TomlNode::Value(DeValue::Array(list))), Some(Ok(index))) => list.get(index),
                _ => None,
            };
            let Some(value) = value else { break };
            found = Some(value.span());
            node = Some(TomlNode::Value(value.get_ref()));
        }
        found
    }

    fn source(&self, span: Option<&Range<usize>>) -> &SourceText {
        let begin = span.map_or(0, |span| span.start);
        self.0.iter().rev().find(|source| source.start <= begin).unwrap_or(&self.0[0])
    }

    /// The folder of the text that the value `key` stands in; none without a working folder.
    pub fn folder_of(&self, key: &str) -> Option<PathBuf> {
        let found = self.span_of(key);
        let path = std::path::absolute(&self.source(found.as_ref()).path).ok()?;
        path.parent().map(Path::to_owned)
    }

    /// The text that `span` lies in, and where in it.
    fn place(&self, span: Option<Range<usize>>) -> Place {
        let source = self.source(span.as_ref());
        let text = &source.padded[source.start..];
        let inside = |place: usize| place.saturating_sub(source.start).min(text.len());
        let name = source.path.display().to_string();
        Place {
            source_code: Arc::new(NamedSource::new(name, text.to_owned()).with_language("toml")),
            span: span.map(|span| SourceSpan::from(inside(span.start)..inside(span.end))),
        }
    }
}

#[derive(Clone, Copy)]
enum TomlNode<'a> {
    Table(&'a DeTable<'a>),
    Value(&'a DeValue<'a>),
}

fn merge<'a>(base: &mut DeTable<'a>, over: DeTable<'a>) {
    for (key, value) in over {
        let span = value.span();
        match (base.get_mut(&key).map(Spanned::get_mut), value.into_inner()) {
            (Some(DeValue::Table(base)), DeValue::Table(over)) => merge(base, over),
            (_, value) => {
                // A map keeps the key it has, whose place is another text.
                base.remove(&key);
                base.insert(key, Spanned::new(span, value));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::config::load;
    use miette::Diagnostic;
    use std::path::{Path, PathBuf};

    const BASE: &str = "# Everything but the seed.\n[data]\n[[data.garments]]\ngenerate = { count = 2 }\n\n[losses.strain]\n\
        weight = 2.0\n\n[[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 10\n";
    const TOP: &str = "extends = \"base.toml\"\nseed = 1\n[model]\nwidth = 8\n";

    /// The text that an error of `path` marks, with its file and line (from 1), and its message.
    fn marked(path: &Path, overrides: &[String]) -> (String, String, usize, String) {
        let error = load(path, overrides).unwrap_err();
        let label =
            error.labels().and_then(|mut labels| labels.next()).unwrap_or_else(|| panic!("{error:?}"));
        let source = error.source_code().unwrap();
        let contents = source.read_span(label.inner(), 0, 0).unwrap();
        let text = String::from_utf8(source.read_span(label.inner(), 0, 0).unwrap().data().to_vec()).unwrap();
        let file = Path::new(contents.name().unwrap()).file_name().unwrap().to_string_lossy().into_owned();
        (file, text, contents.line() + 1, error.to_string())
    }

    fn files(base: &str, top: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("base.toml"), base).unwrap();
        let path = folder.path().join("top.toml");
        std::fs::write(&path, top).unwrap();
        (folder, path)
    }

    #[test]
    fn an_error_names_the_file_and_line_it_stands_in() {
        let base = |from: &str, to: &str| (BASE.replace(from, to), TOP.to_owned());
        let top = |from: &str, to: &str| (BASE.to_owned(), TOP.replace(from, to));
        for ((base, top), file, line, text, reason) in [
            // Unknown keys, wrong types, texts that are no TOML.
            (base("weight = 2.0", "wieght = 2.0"), "base.toml", 7, "wieght", "unknown field"),
            (top("width", "wdith"), "top.toml", 4, "wdith", "unknown field"),
            (base("steps = 10", "steps = \"ten\""), "base.toml", 12, "\"ten\"", "invalid type"),
            (top("width = 8", "width = \"8\""), "top.toml", 4, "\"8\"", "invalid type"),
            (base("steps = 10", "steps = 10 10"), "base.toml", 12, "10", ""),
            (top("seed = 1", "seed = = 1"), "top.toml", 2, "=", ""),
            // Values that contradict each other.
            (base("steps = 10", "steps = 0"), "base.toml", 12, "0", "stages[0].steps"),
            (base("weight = 2.0", "weight = -2.0"), "base.toml", 7, "-2.0", "losses.strain.weight"),
            (top("width = 8", "width = 0"), "top.toml", 4, "0", "model.width"),
            (top("seed = 1", "seed = 1\nstages = []"), "top.toml", 3, "[]", "stages"),
            // Bases that cannot be used.
            (top("base.toml", "none.toml"), "top.toml", 1, "\"none.toml\"", "none.toml"),
            (base("[data]", "extends = 3\n[data]"), "base.toml", 2, "3", "not the name of a file"),
        ] {
            let (_folder, path) = files(&base, &top);
            let (found_file, found, found_line, message) = marked(&path, &[]);
            assert_eq!((found_file.as_str(), found_line), (file, line), "{message}");
            assert!(found.contains(text) && message.contains(reason), "{found:?}: {message}");
        }
    }

    #[test]
    fn what_an_override_breaks_marks_no_line_of_a_file() {
        let (_folder, path) = files(BASE, TOP);
        let error = load(&path, &["stages.0.steps=0".into()]).unwrap_err();
        assert!(error.to_string().contains("stages[0].steps"));
        assert!(error.labels().is_none_or(|mut labels| labels.next().is_none()));
        // What the file itself has wrong still does.
        let (_folder, path) = files(&BASE.replace("steps = 10", "steps = 0"), TOP);
        assert_eq!(marked(&path, &["seed=4".into()]).2, 12);
    }
}
