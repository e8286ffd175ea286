//! The paths in a configuration: absolute in memory, written relative to the folder in which the run was started, so that a run
//! resumes from any folder and its configuration can be handed on. What is read is looked for beside the configuration first.

use super::run::Config;
use std::path::{Path, PathBuf};

/// The body that is no file.
const MANNEQUIN: &str = "mannequin";

/// Key of the one path that is written to: it need not exist, and is never looked for.
const CACHE: &str = "data.cache.folder";

/// A file or folder that a configuration names and that is not there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingInput {
    /// The key.
    pub key: String,
    /// Its value.
    pub value: String,
    /// The folder that it is relative to, unless it is beside the configuration.
    pub folder: PathBuf,
}

impl Config {
    /// The same with absolute paths: relative ones are relative to `base`, where that folder exists, else to the working folder,
    /// which becomes the base. What is read lies beside the configuration where it is there, in the folder of the text with
    /// its key, `folder_of`; only what is found in a recorded base goes before that.
    #[must_use]
    pub(super) fn with_absolute_paths(mut self, folder_of: impl Fn(&str) -> Option<PathBuf>) -> Self {
        let recorded = self.base.take().filter(|base| base.is_dir());
        let is_recorded = recorded.is_some();
        // Without a working folder relative paths lead nowhere, and are named as they are when they are opened.
        let Some(base) = recorded.or_else(|| std::env::current_dir().ok()) else { return self };
        self.change_paths(|key, path| {
            let usual = base.join(path);
            if path.is_absolute() || key == CACHE || is_recorded && usual.exists() {
                return usual;
            }
            let beside = folder_of(key).map(|folder| folder.join(path));
            beside.filter(|beside| beside.exists()).unwrap_or(usual)
        });
        self.base = Some(base);
        self
    }

    /// The first file or folder of the data that is not there.
    pub fn missing_input(&self) -> Option<MissingInput> {
        let folder = self.base.clone().unwrap_or_default();
        let mut missing = None;
        self.clone().change_paths(|key, path| {
            if missing.is_none() && key.starts_with("data.") && key != CACHE && !path.exists() {
                let value = path.strip_prefix(&folder).unwrap_or(path).display().to_string();
                missing = Some(MissingInput { key: key.to_owned(), value, folder: folder.clone() });
            }
            path.to_owned()
        });
        missing
    }

    /// The same with paths relative to its base, where they lie below it.
    #[must_use]
    pub(super) fn with_relative_paths(&self) -> Self {
        let mut config = self.clone();
        let Some(base) = &self.base else { return config };
        config.change_paths(|_, path| {
            let below = path.strip_prefix(base).ok().filter(|rest| !rest.as_os_str().is_empty());
            below.unwrap_or(path).to_owned()
        });
        config
    }

    /// `change` gets the key of every path and the path.
    fn change_paths(&mut self, mut change: impl FnMut(&str, &Path) -> PathBuf) {
        let mut change_text = |key: &str, text: &mut String| {
            // A name that is no text cannot be a text either when it is made longer.
            if let Some(changed) = change(key, Path::new(text.as_str())).to_str() {
                *text = changed.to_owned();
            }
        };
        if self.data.body != MANNEQUIN {
            change_text("data.body", &mut self.data.body);
        }
        self.init_from.iter_mut().for_each(|path| change_text("init_from", path));
        for (i, source) in self.data.garments.iter_mut().enumerate() {
            source
                .folder
                .iter_mut()
                .for_each(|path| *path = change(&format!("data.garments[{i}].folder"), path));
        }
        self.data.poses.motions.iter_mut().for_each(|path| *path = change("data.poses.motions", path));
        self.data.cache.folder.iter_mut().for_each(|path| *path = change(CACHE, path));
    }
}

#[cfg(test)]
mod tests {
    use crate::config::{parse, to_toml};
    use std::path::Path;

    const SMALL: &str = "seed = 1\ninit_from = \"models/a\"\n[data]\nbody = \"body.npz\"\ncache = { folder = \"/var/cache/x\" }\n\
        [[data.garments]]\nfolder = \"clothes\"\n[[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 10\n";

    #[test]
    fn paths_are_absolute_in_memory_and_relative_to_their_base_on_disk() {
        let base = tempfile::tempdir().unwrap();
        let text = format!("base = {:?}\n{SMALL}", base.path());
        let read = |text: &str, overrides: &[String]| parse(text, Path::new("a.toml"), overrides).unwrap();
        let config = read(&text, &[]);
        assert_eq!(Path::new(&config.data.body), base.path().join("body.npz"));
        assert_eq!(config.data.garments[0].folder, Some(base.path().join("clothes")));
        assert_eq!(config.init_from, Some(base.path().join("models/a").display().to_string()));
        let written = to_toml(&config).unwrap();
        for line in
            ["body = \"body.npz\"", "folder = \"clothes\"", "folder = \"/var/cache/x\"", "\"models/a\""]
        {
            assert!(written.contains(line), "{line} is missing in {written}");
        }
        assert_eq!(to_toml(&read(&written, &[])).unwrap(), written);

        // What is there is found beside the configuration, also once the base is gone, and a missing file is named with its key.
        let beside = tempfile::tempdir().unwrap();
        std::fs::write(beside.path().join("body.npz"), "").unwrap();
        std::fs::create_dir(beside.path().join("clothes")).unwrap();
        let moved = |text: &str| parse(text, &beside.path().join("a.toml"), &[]).unwrap();
        for text in [text.as_str(), SMALL] {
            let config = moved(text);
            assert_eq!(Path::new(&config.data.body), beside.path().join("body.npz"));
            assert_eq!(
                (config.data.garments[0].folder.clone(), config.missing_input()),
                (Some(beside.path().join("clothes")), None)
            );
        }
        std::fs::write(base.path().join("body.npz"), "").unwrap();
        assert_eq!(Path::new(&moved(&text).data.body), base.path().join("body.npz"), "what was used before");
        std::fs::remove_dir(beside.path().join("clothes")).unwrap();
        let missing = moved(&text).missing_input().unwrap();
        assert_eq!((missing.key.as_str(), missing.value.as_str()), ("data.garments[0].folder", "clothes"));
        assert_eq!(missing.folder, base.path());

        // What is typed is relative to where it is typed; so is everything once the base is gone.
        let here = std::env::current_dir().unwrap();
        let typed = read(&text, &["data.body=other.npz".into()]);
        assert_eq!(Path::new(&typed.data.body), here.join("other.npz"));
        drop(base);
        assert_eq!(Path::new(&read(&text, &[]).data.body), here.join("body.npz"));
        assert_eq!(read(&text.replace("body.npz", "mannequin"), &[]).data.body, "mannequin");
    }
}
