//! The paths in a configuration: absolute in memory, written relative to the folder in which the run was started, so that a run
//! resumes from any folder and its configuration can be handed on.

use super::Config;
use std::path::{Path, PathBuf};

/// The body that is no file.
const MANNEQUIN: &str = "mannequin";

impl Config {
    /// The same with absolute paths: relative ones are relative to `base`, where that folder exists, else to the working folder,
    /// which becomes the base.
    #[must_use]
    pub(super) fn with_absolute_paths(mut self) -> Self {
        let recorded = self.base.take().filter(|base| base.is_dir());
        // Without a working folder relative paths lead nowhere, and are named as they are when they are opened.
        let Some(base) = recorded.or_else(|| std::env::current_dir().ok()) else { return self };
        self.change_paths(|path| base.join(path));
        self.base = Some(base);
        self
    }

    /// The same with paths relative to its base, where they lie below it.
    #[must_use]
    pub(super) fn with_relative_paths(&self) -> Self {
        let mut config = self.clone();
        let Some(base) = &self.base else { return config };
        config.change_paths(|path| {
            let below = path.strip_prefix(base).ok().filter(|rest| !rest.as_os_str().is_empty());
            below.unwrap_or(path).to_owned()
        });
        config
    }

    fn change_paths(&mut self, change: impl Fn(&Path) -> PathBuf) {
        let change_text = |text: &mut String| {
            // A name that is no text cannot be a text either when it is made longer.
            if let Some(changed) = change(Path::new(text.as_str())).to_str() {
                *text = changed.to_owned();
            }
        };
        if self.data.body != MANNEQUIN {
            change_text(&mut self.data.body);
        }
        self.init_from.iter_mut().for_each(change_text);
        let garments = self.data.garments.iter_mut().filter_map(|source| source.folder.as_mut());
        let single = [self.data.poses.motions.as_mut(), self.data.cache.folder.as_mut()];
        garments.chain(single.into_iter().flatten()).for_each(|path| *path = change(path));
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

        // What is typed is relative to where it is typed; so is everything once the base is gone.
        let here = std::env::current_dir().unwrap();
        let typed = read(&text, &["data.body=other.npz".into()]);
        assert_eq!(Path::new(&typed.data.body), here.join("other.npz"));
        drop(base);
        assert_eq!(Path::new(&read(&text, &[]).data.body), here.join("body.npz"));
        assert_eq!(read(&text.replace("body.npz", "mannequin"), &[]).data.body, "mannequin");
    }
}
