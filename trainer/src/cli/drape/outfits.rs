//! A TOML file of outfits.

use super::job::{Job, SceneArguments};
use miette::{IntoDiagnostic, Report as Failure, WrapErr, miette};
use serde::Deserialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Outfits {
    outfit: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Option<String>,
    garments: Vec<String>,
    order: Option<Vec<usize>>,
    shape: Option<Vec<f64>>,
    pose: Option<String>,
    motion: Option<PathBuf>,
    frames: Option<String>,
    every: Option<u32>,
}

/// Reads the outfits of `file`. What an outfit does not say about the body is taken from `scene`; paths are relative to the
/// file's folder, or to the working folder where there is no such file.
pub(super) fn read(file: &Path, scene: &SceneArguments) -> Result<Vec<Job>, Failure> {
    let text = std::fs::read_to_string(file)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", file.display()))?;
    let outfits: Outfits = toml::from_str(&text).map_err(|e| miette!("{}: {e}", file.display()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut names = HashSet::new();
    let jobs = outfits.outfit.into_iter().enumerate().map(|(number, entry)| {
        let wrong = |what: String| miette!("{}: outfit {}: {what}", file.display(), number + 1);
        let name = entry.name.unwrap_or_else(|| format!("outfit-{}", number + 1));
        let is_plain = |c: char| c.is_alphanumeric() || "-_+. ".contains(c);
        if name.trim_matches('.').is_empty() || !name.chars().all(is_plain) {
            return Err(wrong(format!("the name {name:?} cannot be that of a folder")));
        }
        if !names.insert(name.to_lowercase()) {
            return Err(wrong(format!("the name {name:?} is used twice")));
        }
        let beside = |path: &str| match folder.join(path) {
            found if found.is_file() => found.display().to_string(),
            _ => path.to_owned(),
        };
        let mut own = scene.clone();
        if entry.pose.is_some() || entry.motion.is_some() {
            (own.posed, own.t_pose) = (None, None);
        }
        if let Some(shape) = entry.shape {
            if own.t_pose.is_some() {
                return Err(wrong("a shape beside --t-pose, which has its own".to_owned()));
            }
            own.shape = shape;
        }
        match (entry.pose, entry.motion) {
            (Some(_), Some(_)) => return Err(wrong("both pose and motion".to_owned())),
            (Some(pose), None) => (own.pose, own.motion) = (Some(pose_beside(&pose, beside)), None),
            (None, Some(motion)) => {
                (own.pose, own.motion) = (None, Some(beside(&motion.display().to_string()).into()));
            }
            (None, None) => {}
        }
        if let Some(frames) = entry.frames {
            own.frames = Some(frames.parse().map_err(wrong)?);
        }
        own.every = match entry.every {
            Some(0) => return Err(wrong("every = 0 takes no frame".to_owned())),
            every => every.or(own.every),
        };
        if own.motion.is_none() && (own.frames.is_some() || entry.every.is_some()) {
            return Err(wrong("frames of no motion".to_owned()));
        }
        if entry.garments.is_empty() {
            return Err(wrong("it has no garments".to_owned()));
        }
        let garments = entry.garments.iter().map(|g| beside(g)).collect();
        Ok(Job { name, garments, order: entry.order, scene: own })
    });
    let jobs = jobs.collect::<Result<Vec<_>, _>>()?;
    match jobs.is_empty() {
        true => Err(miette!(help = "add an [[outfit]]", "{} holds no outfit", file.display())),
        false => Ok(jobs),
    }
}

/// The path of `FILE:FRAME` beside the file of outfits.
fn pose_beside(pose: &str, beside: impl Fn(&str) -> String) -> String {
    match pose.rsplit_once(':') {
        Some((path, frame)) if frame.bytes().all(|b| b.is_ascii_digit()) => {
            format!("{}:{frame}", beside(path))
        }
        _ => beside(pose),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Vec<Job>, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("tee.obj"), "x").unwrap();
        let file = folder.path().join("outfits.toml");
        std::fs::write(&file, text).unwrap();
        let scene = SceneArguments { shape: vec![0.5], every: Some(3), ..SceneArguments::default() };
        read(&file, &scene).map_err(|e| e.to_string())
    }

    #[test]
    fn outfits_take_over_what_they_do_not_say_and_find_files_beside_them() {
        let jobs = read_text(
            "[[outfit]]\ngarments = [\"tee.obj\", \"coat\"]\n[[outfit]]\nname = \"b\"\ngarments = [\"coat\"]\n\
             shape = [1]\nmotion = \"walk.npz\"\nframes = \"2..4\"\nevery = 1\n",
        )
        .unwrap();
        assert_eq!(jobs[0].name, "outfit-1");
        assert!(jobs[0].garments[0].ends_with("/tee.obj") && jobs[0].garments[1] == "coat");
        assert_eq!((&jobs[0].scene.shape, jobs[0].scene.every), (&vec![0.5], Some(3)));
        assert_eq!((&jobs[1].scene.shape, jobs[1].scene.every), (&vec![1.0], Some(1)));
        assert_eq!(jobs[1].scene.frames, "2..4".parse().ok());
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("[[outfit]]\ngarments = [\"a\"]\ncolour = 1\n", "colour"),
            ("[[outfit]]\nname = \"a/b\"\ngarments = [\"a\"]\n", "a/b"),
            (
                "[[outfit]]\nname = \"a\"\ngarments = [\"x\"]\n[[outfit]]\nname = \"A\"\ngarments = []\n",
                "twice",
            ),
            ("[[outfit]]\ngarments = []\n", "no garments"),
            ("[[outfit]]\ngarments = []\nframes = \"9..1\"\n", "9..1"),
            ("[[outfit]]\ngarments = []\nframes = \"0..4\"\n", "no motion"),
            ("[[outfit]]\ngarments = []\npose = \"a\"\nmotion = \"b\"\n", "both"),
            ("outfit = []\n", "no outfit"),
        ] {
            let message = read_text(text).unwrap_err();
            assert!(message.contains(part) && message.contains("outfits.toml"), "{message}");
        }
    }
}
