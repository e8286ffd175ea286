//! Reading a configuration: file, then `--set` overrides, then consistency; errors show the place.

use super::error::ConfigError;
use super::reworded::{present_name, reworded};
use super::run::Config;
use super::sources::{Place, Sources};
use serde::Deserialize;
use std::path::Path;

/// Reads `path`, applies `overrides` (`a.b=value`; list elements by index) in order, and checks the result.
///
/// # Errors
/// [`ConfigError`] names the line of the file, or the override, at fault.
pub fn load(path: &Path, overrides: &[String]) -> Result<Config, ConfigError> {
    let text = std::fs::read_to_string(path)
        .map_err(|reason| ConfigError::Unreadable { path: path.to_owned(), reason })?;
    parse(&text, path, overrides)
}

/// As [`load`], of a text that was read from `path`.
///
/// # Errors
/// As [`load`].
pub fn parse(text: &str, path: &Path, overrides: &[String]) -> Result<Config, ConfigError> {
    let sources = Sources::read(text, path)?;
    let tree = toml::de::Deserializer::from(sources.tree()?);
    let mut config = Config::deserialize(tree).map_err(|error| sources.invalid(&error))?;
    let of_the_files = config.problem();
    config = config.with_absolute_paths(|key| sources.folder_of(key));
    if !overrides.is_empty() {
        let mut tree: toml::Value = toml::Value::try_from(&config)
            .map_err(|e| ConfigError::BadOverride { setting: String::new(), message: e.to_string() })?;
        for setting in overrides {
            let bad = |message: String| ConfigError::BadOverride { setting: shortened(setting), message };
            apply(&mut tree, setting).map_err(bad)?;
            config = tree.clone().try_into().map_err(|e: toml::de::Error| bad(reworded(e.message())))?;
        }
        let base = config.base.take();
        // What is typed is relative to where it is typed.
        config = Config { base, ..config.with_absolute_paths(|_| None) };
    }
    match config.problem() {
        None => Ok(config),
        Some(problem) => {
            let is_in_a_file = of_the_files.as_ref() == Some(&problem);
            let (place, what, hint) = problem;
            let sets = |setting: &&String| {
                setting.split('=').next().is_some_and(|key| place.starts_with(key.trim()))
            };
            if let (false, Some(setting)) = (is_in_a_file, overrides.iter().rev().find(sets)) {
                let message = format!("{place} {what}; hint: {hint}");
                return Err(ConfigError::BadOverride { setting: shortened(setting), message });
            }
            let Place { source_code, span } = sources.place_of(&place);
            let span = span.filter(|_| is_in_a_file);
            Err(ConfigError::Inconsistent { place, what, hint, source_code, span })
        }
    }
}

/// The configuration as TOML text, every value spelled out.
///
/// # Errors
/// When a value has no TOML form (an integer beyond 2⁶³).
pub fn to_toml(config: &Config) -> Result<String, toml::ser::Error> {
    toml::to_string_pretty(&config.with_relative_paths())
}

/// The beginning of an override, which may be as long as the command line.
fn shortened(setting: &str) -> String {
    const SHOWN: usize = 120;
    match setting.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &setting[..end]),
        None => setting.to_owned(),
    }
}

/// Tables within tables of an override at most; no key of a configuration lies that deep, and each costs stack.
const MOST_PARTS: usize = 32;

fn apply(tree: &mut toml::Value, setting: &str) -> Result<(), String> {
    let (key, value) = setting.split_once('=').ok_or("there is no '='")?;
    let parts = key.split('.').count();
    if parts > MOST_PARTS {
        return Err(format!("the key has {parts} parts, none has more than {MOST_PARTS}"));
    }
    // A bare word is a string: `--set data.body=body.npz` needs no quotes.
    let value = toml::from_str::<toml::Table>(&format!("v = {value}"))
        .ok()
        .and_then(|mut t| t.remove("v"))
        .unwrap_or_else(|| toml::Value::String(value.to_owned()));
    let mut node = tree;
    let mut parts = key.trim().split('.').peekable();
    while let Some(part) = parts.next() {
        let last = parts.peek().is_none();
        node = match node {
            toml::Value::Table(table) => {
                if last {
                    table.insert(present_name(part).to_owned(), value);
                    return Ok(());
                }
                table.entry(part).or_insert_with(|| toml::Value::Table(toml::Table::new()))
            }
            toml::Value::Array(list) => {
                let count = list.len();
                let index: usize =
                    part.parse().map_err(|_| format!("`{part}` is not the index of a list element"))?;
                let element = list
                    .get_mut(index)
                    .ok_or(format!("element {index} does not exist, there are {count}"))?;
                if last {
                    *element = value;
                    return Ok(());
                }
                element
            }
            _ => return Err(format!("`{part}` is below a plain value")),
        };
    }
    Err("the key is empty".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "seed = 1\n[data]\n[[data.garments]]\ngenerate = { count = 2 }\n[[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 10\n";

    fn written(text: &str) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        file
    }

    #[test]
    fn overrides_reach_lists_and_tables() {
        let f = written(SMALL);
        let c = load(
            f.path(),
            &["stages.0.steps=7".into(), "losses.strain.weight=2".into(), "data.body=some.npz".into()],
        )
        .unwrap();
        assert_eq!((c.stages[0].steps, c.losses.strain.weight.at(0.0)), (7, 2.0));
        assert!(c.data.body.ends_with("/some.npz"), "{}", c.data.body);
    }

    #[test]
    fn an_override_of_a_key_without_end_is_refused() {
        let f = written(SMALL);
        let e = load(f.path(), &[format!("{}=1", vec!["a"; 60_000].join("."))]).unwrap_err();
        // Its whole text would fill the terminal.
        let text = e.to_string();
        assert!(text.contains("60000 parts") && text.len() < 400, "{} bytes", text.len());
        for value in ["[".repeat(60_000), "{a=".repeat(60_000)] {
            assert!(load(f.path(), &[format!("data.body={value}")]).is_ok(), "a bare word is a string");
        }
    }

    #[test]
    fn resolved_text_reads_back_to_the_same_text() {
        let f = written(SMALL);
        let text = to_toml(&load(f.path(), &[]).unwrap()).unwrap();
        let g = written(&text);
        assert_eq!(to_toml(&load(g.path(), &[]).unwrap()).unwrap(), text);
    }

    #[test]
    fn an_unknown_key_shows_its_place_and_the_valid_names() {
        let f = written(&SMALL.replace("steps = 10", "step = 10"));
        match load(f.path(), &[]).unwrap_err() {
            ConfigError::Invalid { message, span, .. } => {
                assert!(message.contains("step") && message.contains("learning_rate"), "{message}");
                assert!(span.is_some());
            }
            other => panic!("{other}"),
        }
        let e = load(written(SMALL).path(), &["losses.strian.weight=1".into()]).unwrap_err();
        assert!(e.to_string().contains("strian"), "{e}");
        // A key that is gone names its successors.
        let gone = SMALL.replace("[data]\n", "[data]\nposes = { held_out_clips = [] }\n");
        let setting = "data.poses.held_out_clips=[]".to_owned();
        for e in [load(written(&gone).path(), &[]), load(written(SMALL).path(), &[setting])] {
            let text = e.unwrap_err().to_string();
            assert!(text.contains("data.poses.validation_clips") && text.contains("test_clips"), "{text}");
        }
    }

    #[test]
    fn earlier_names_of_keys_are_read_from_files_and_overrides() {
        let early = format!("{SMALL}\n[losses]\nalone = 0.25\n")
            .replace("steps = 10", "steps = 10\nscenes_per_step = 2");
        let in_file = load(written(&early).path(), &[]).unwrap();
        let settings = ["losses.alone=0.25".to_owned(), "stages.0.scenes_per_step=2".to_owned()];
        for config in [in_file, load(written(SMALL).path(), &settings).unwrap()] {
            assert_eq!((config.losses.single_garments, config.stages[0].bodies), (0.25.into(), 2));
        }
        let list = load(written(SMALL).path(), &["losses.body_collision.samples=[]".to_owned()]);
        assert!(list.unwrap_err().to_string().contains("one name"));
    }

    #[test]
    fn garments_below_need_networks_that_see_them() {
        let load = |settings: &[&str]| {
            load(written(SMALL).path(), &settings.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>())
        };
        let unseen = load(&["stages.0.below=2"]).unwrap_err().to_string();
        assert!(unseen.contains("do not see the garments below"), "{unseen}");
        assert_eq!(
            load(&["stages.0.below=2", "model.surroundings=8"]).unwrap().layer_thickness(),
            Some(0.002)
        );
    }

    #[test]
    fn a_configuration_extends_another() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        file("base.toml", SMALL);
        file("middle.toml", "extends = \"base.toml\"\n[losses.strain]\nweight = 3.0\n[model]\nwidth = 9\n");
        let top = file("top.toml", "extends = \"middle.toml\"\nseed = 5\n[model]\nembedding = 7\n");
        let c = load(&top, &["losses.bending.weight=2".into()]).unwrap();
        assert_eq!((c.seed, c.model.width, c.model.embedding, c.stages[0].steps), (5, 9, 7, 10));
        assert_eq!((c.losses.strain.weight.at(0.0), c.losses.bending.weight.at(0.0)), (3.0, 2.0));
        for (text, reason) in [
            ("extends = \"none.toml\"", "none.toml"),
            ("extends = 3", "not the name of a file"),
            ("extends = \"wrong.toml\"", "extend each other"),
            ("extends = \"base.toml\"\nsede = 1", "sede"),
        ] {
            let e = load(&file("wrong.toml", text), &[]).unwrap_err();
            assert!(e.to_string().contains(reason), "{e}");
        }
    }

    #[test]
    fn margins_that_leave_nothing_to_train_on_are_refused() {
        let moving = SMALL.replace("[data]\n", "[data]\nposes = { motions = \"motions\" }\n");
        let load = |text: &str, settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(|s| format!("data.poses.{s}")).collect();
            load(written(text).path(), &settings)
        };
        assert_eq!(load(&moving, &[]).unwrap().data.poses.held_out_margin, 1.0);
        for settings in [&["held_out_share=0.5"][..], &["held_out_block=0.2"], &["held_out_margin=-1"]] {
            let e = load(&moving, settings).unwrap_err().to_string();
            assert!(e.contains("data.poses.held_out_margin"), "{settings:?}: {e}");
        }
        assert!(load(&moving, &["held_out_share=0.5", "held_out_block=4"]).is_ok());
        // Sampled poses have no windows.
        assert!(load(SMALL, &["held_out_share=0.5"]).is_ok());
    }

    #[test]
    fn contradictions_are_named() {
        let f = written(&SMALL.replace("steps = 10", "steps = 10\nlayers = [1, 3]"));
        assert!(load(f.path(), &[]).unwrap_err().to_string().contains("stages[0].layers"));
        for key in ["losses.single_garments", "losses.strain.weight", "losses.reference_vertices"] {
            for value in ["-1", "nan", "inf"] {
                let e = load(written(SMALL).path(), &[format!("{key}={value}")]).unwrap_err();
                assert!(e.to_string().contains(key), "{e}");
            }
        }
        assert!(load(written(SMALL).path(), &["losses.reference_vertices=0".into()]).is_ok());
    }
}
