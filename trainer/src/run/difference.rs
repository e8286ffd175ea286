//! In which keys two configurations differ, with both values, and which differences are allowed.

use crate::config::{CacheConfig, Config, GuardConfig, OutputConfig};
use std::collections::BTreeSet;
use std::fmt;
use toml::Value;

/// A key with another value.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The key, as a dotted path.
    pub key: String,
    /// Its value in the first configuration, in short; none where it is not set.
    pub first: Option<String>,
    /// In the second.
    pub second: Option<String>,
}

/// Longest value that is shown whole (characters).
const SHOWN_VALUE: usize = 60;

/// Most differences that are shown.
const MOST_LISTED: usize = 12;

impl Difference {
    /// The difference in words, the configurations being called `first` and `second`.
    pub fn text(&self, first: &str, second: &str) -> String {
        let side = |value: &Option<String>, name: &str| match value {
            Some(value) => format!("{value} in {name}"),
            None => format!("not set in {name}"),
        };
        format!("{}: {}, {}", self.key, side(&self.first, first), side(&self.second, second))
    }
}

/// `lines` one below the other, each begun anew; many are cut short.
pub fn listed<T: fmt::Display>(lines: impl IntoIterator<Item = T>) -> String {
    let lines: Vec<String> = lines.into_iter().map(|line| format!("\n  {line}")).collect();
    let more = lines.len().saturating_sub(MOST_LISTED);
    let end = if more > 0 { format!("\n  … and {more} more") } else { String::new() };
    lines[..lines.len() - more].concat() + &end
}

/// Keys whose values differ. What only concerns output may change between sessions.
pub fn differences(first: &Config, second: &Config) -> Vec<Difference> {
    let mut found = Vec::new();
    walk("", comparable(first).as_ref(), comparable(second).as_ref(), &mut found);
    found
}

/// The same without values.
pub fn differing_keys(first: &Config, second: &Config) -> Vec<String> {
    differences(first, second).into_iter().map(|difference| difference.key).collect()
}

fn walk(path: &str, first: Option<&Value>, second: Option<&Value>, found: &mut Vec<Difference>) {
    match (first, second) {
        (Some(Value::Table(a)), Some(Value::Table(b))) => {
            let names: BTreeSet<_> = a.keys().chain(b.keys()).collect();
            for name in names {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                walk(&path, a.get(name), b.get(name), found);
            }
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) if a.len() == b.len() => {
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                walk(&format!("{path}[{i}]"), Some(a), Some(b), found);
            }
        }
        (a, b) if a == b => {}
        (a, b) => {
            let [first, second] = [a, b].map(|value| value.map(short));
            found.push(Difference { key: path.to_owned(), first, second });
        }
    }
}

/// A value on one line.
fn short(value: &Value) -> String {
    let text = value.to_string();
    match (value, text.chars().count()) {
        (_, length) if length <= SHOWN_VALUE => text,
        (Value::Array(list), _) => format!("{} elements", list.len()),
        _ => text.chars().take(SHOWN_VALUE).chain("…".chars()).collect(),
    }
}

/// The configuration without what changes no result: where things are kept, and when a run gives up.
fn comparable(config: &Config) -> Option<Value> {
    let mut config = config.clone();
    config.base = None;
    config.output = OutputConfig::default();
    config.guard = GuardConfig { inject: config.guard.inject, ..Default::default() };
    config.data.cache = CacheConfig::default();
    (config.data.memory_mib, config.data.device_memory_mib) = (1, 1);
    Value::try_from(config).ok()
}

/// Keys that may change, as `--allow-config-change` names them; a section allows all in it.
#[derive(Clone, Debug, Default)]
pub struct AllowedChanges(Vec<String>);

impl AllowedChanges {
    /// Those of `keys`.
    ///
    /// # Errors
    /// The first that is a key of none of `configs`.
    pub fn new(keys: &[String], configs: &[&Config]) -> Result<Self, String> {
        match keys.iter().find(|key| !is_known(key, configs)) {
            Some(unknown) => Err(unknown.clone()),
            None => Ok(Self(keys.to_vec())),
        }
    }

    /// Whether `key` may change.
    pub fn covers(&self, key: &str) -> bool {
        self.0.iter().any(|allowed| lies_in(key, allowed))
    }

    /// Whether `key` or anything in it may change.
    pub fn touches(&self, key: &str) -> bool {
        self.covers(key) || self.0.iter().any(|allowed| lies_in(allowed, key))
    }
}

/// Whether `key` is `section` or lies in it.
fn lies_in(key: &str, section: &str) -> bool {
    key.strip_prefix(section).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// Whether `key` names a value or section of one of `configs`.
fn is_known(key: &str, configs: &[&Config]) -> bool {
    configs.iter().any(|config| {
        let tree = Value::try_from(*config).ok();
        let mut node = tree.as_ref();
        for part in key.split(['.', '[']) {
            node = match (node, part.strip_suffix(']')) {
                (Some(node), Some(index)) => index.parse::<usize>().ok().and_then(|i| node.get(i)),
                (Some(node), None) => node.get(part),
                (None, _) => None,
            };
        }
        node.is_some()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;
    use std::path::Path;

    #[test]
    fn differences_have_both_values_in_short() {
        let config = |overrides: &[&str]| {
            let text = "seed = 1\n[data]\n[[data.garments]]\ngenerate = { count = 2 }\n[[stages]]\nname = \"single\"\n\
                trains = \"single\"\nsteps = 10\n";
            let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
            parse(text, Path::new("small.toml"), &overrides).unwrap()
        };
        let changed = config(&[
            "model.width=32",
            "init_from=\"/models/a\"",
            "output.keep_checkpoints=9",
            "data.memory_mib=7",
        ]);
        let found: Vec<String> = differences(&changed, &config(&[]))
            .iter()
            .map(|d| d.text("the configuration", "the run"))
            .collect();
        let width = config(&[]).model.width;
        assert_eq!(
            found,
            [
                "init_from: \"/models/a\" in the configuration, not set in the run".to_owned(),
                format!("model.width: 32 in the configuration, {width} in the run"),
            ]
        );
        assert_eq!(listed(1..=2), "\n  1\n  2");
        assert!(listed(1..=20).ends_with("\n  12\n  … and 8 more"));
        let allowed = AllowedChanges::new(&["model.width".into()], &[&changed]).unwrap();
        assert!(allowed.covers("model.width") && !allowed.covers("model.widths") && !allowed.covers("model"));
        assert!(allowed.touches("model") && !allowed.touches("data"));
        assert_eq!(AllowedChanges::new(&["modle".into()], &[&changed]).unwrap_err(), "modle");
    }
}
