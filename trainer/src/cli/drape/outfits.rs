//! A TOML file of outfits.

use super::job::{Job, RequestedGarment, SceneArguments, ordered};
use clothcombo_data::asset::GarmentMaterial;
use clothcombo_data::fit::FitSettings;
use clothcombo_data::fit::hints::GarmentHints;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde::Deserialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The report of all outfits, beside their folders.
pub(super) const REPORT: &str = "report.json";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Outfits {
    outfit: Vec<OutfitEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutfitEntry {
    name: Option<String>,
    /// Names, or tables with a file and hints.
    garments: Vec<toml::Value>,
    order: Option<Vec<usize>>,
    shape: Option<Vec<f64>>,
    pose: Option<String>,
    motion: Option<PathBuf>,
    frames: Option<String>,
    every: Option<u32>,
}

/// Reads the outfits of `file`. What an outfit does not say about the body is taken from `scene`, and what it does not
/// say about a garment from `hints` and `material`; paths are relative to the file's folder, or to the working folder where there is
/// no such file.
pub(super) fn read(
    file: &Path,
    scene: &SceneArguments,
    hints: &FitSettings,
    material: GarmentMaterial,
) -> Result<Vec<Job>, Report> {
    let text = std::fs::read_to_string(file)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", file.display()))?;
    let outfits: Outfits = toml::from_str(&text).map_err(|e| miette!("{}: {e}", file.display()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut names = HashSet::new();
    let jobs = outfits.outfit.into_iter().enumerate().map(|(number, entry)| {
        let wrong = |what: String| miette!("{}: outfit {}: {what}", file.display(), number + 1);
        let name = entry.name.unwrap_or_else(|| format!("outfit-{}", number + 1));
        if !is_folder_name(&name) {
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
        if entry.pose.is_some() && entry.motion.is_some() {
            return Err(wrong("both pose and motion".to_owned()));
        }
        if entry.pose.is_some() || entry.motion.is_some() {
            (own.posed, own.t_pose) = (None, None);
            own.pose = entry.pose.map(|pose| pose_beside(&pose, beside));
            own.motion = entry.motion.map(|motion| beside(&motion.display().to_string()).into());
        }
        if let Some(shape) = entry.shape {
            if own.t_pose.is_some() {
                return Err(wrong("a shape beside --t-pose, which has its own".to_owned()));
            }
            own.shape = shape;
        }
        let named_frames = entry.frames.is_some() || entry.every.is_some();
        if let Some(frames) = entry.frames {
            own.frames = Some(frames.parse().map_err(wrong)?);
        }
        own.every = match entry.every {
            Some(0) => return Err(wrong("every = 0 takes no frame".to_owned())),
            every => every.or(own.every),
        };
        if own.motion.is_none() {
            if named_frames {
                return Err(wrong("frames of no motion".to_owned()));
            }
            // Those of the command line are for outfits in motion.
            (own.frames, own.every) = (None, None);
        }
        if entry.garments.is_empty() {
            return Err(wrong("it has no garments".to_owned()));
        }
        let garments = entry.garments.into_iter().enumerate().map(|(number, value)| {
            let wanted = garment(value, (hints, material), beside)
                .map_err(|what| wrong(format!("garment {}: {what}", number + 1)))?;
            Ok(RequestedGarment { name: beside(&wanted.name), ..wanted })
        });
        let garments = ordered(garments.collect::<Result<_, Report>>()?, entry.order.as_deref())
            .wrap_err_with(|| format!("outfit {name}"))?;
        Ok(Job { name, garments, scene: own })
    });
    let jobs = jobs.collect::<Result<Vec<_>, _>>()?;
    if jobs.is_empty() {
        return Err(miette!(help = "add an [[outfit]]", "{} holds no outfit", file.display()));
    }
    if (scene.frames.is_some() || scene.every.is_some()) && jobs.iter().all(|job| job.scene.motion.is_none())
    {
        return Err(miette!(
            help = "give an outfit motion = \"FILE\", or all of them --motion FILE",
            "--frames or --every, but no outfit of {} has a motion",
            file.display()
        ));
    }
    Ok(jobs)
}

/// A name, or a table with a file and hints.
fn garment(
    value: toml::Value,
    (hints, material): (&FitSettings, GarmentMaterial),
    beside: impl Fn(&str) -> String,
) -> Result<RequestedGarment, String> {
    match value {
        toml::Value::String(name) => Ok(RequestedGarment { name, hints: hints.clone(), material }),
        toml::Value::Table(table) => {
            let entry: GarmentHints =
                table.try_into().map_err(|e: toml::de::Error| e.message().to_owned())?;
            entry.material.check()?;
            let material = entry.material.or(material);
            Ok(RequestedGarment { hints: entry.settings(hints, beside)?, name: entry.file, material })
        }
        other => Err(format!(
            "it is of type {}, neither a name nor a table such as {{ file = \"tee.obj\", unit = \"cm\" }}",
            other.type_str()
        )),
    }
}

/// Whether `name` can be that of a folder on every system, beside the report of all outfits. One that begins with a dot would
/// be hidden, and Windows drops dots and blanks at the end.
fn is_folder_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_alphanumeric() || "-_+. ".contains(c);
    !name.trim().is_empty()
        && name.chars().all(is_plain)
        && !name.starts_with('.')
        && !name.ends_with(['.', ' '])
        && !name.eq_ignore_ascii_case(REPORT)
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
    use clothcombo_data::fit::{Keep, Unit};

    fn read_text(text: &str) -> Result<Vec<Job>, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("tee.obj"), "x").unwrap();
        let file = folder.path().join("outfits.toml");
        std::fs::write(&file, text).unwrap();
        let scene = SceneArguments { shape: vec![0.5], every: Some(3), ..SceneArguments::default() };
        let material = GarmentMaterial { density: Some(300.0), ..GarmentMaterial::default() };
        read(&file, &scene, &FitSettings::default(), material).map_err(|e| e.to_string())
    }

    #[test]
    fn outfits_take_over_what_they_do_not_say_and_find_files_beside_them() {
        let jobs = read_text(
            "[[outfit]]\ngarments = [\"tee.obj\", \"coat\"]\n[[outfit]]\nname = \"b\"\ngarments = [\"coat\"]\n\
             shape = [1]\nmotion = \"walk.npz\"\nframes = \"2..4\"\nevery = 1\n",
        )
        .unwrap();
        assert_eq!(jobs[0].name, "outfit-1");
        assert!(jobs[0].garments[0].name.ends_with("/tee.obj") && jobs[0].garments[1].name == "coat");
        // It does not move: what --every says is for the other.
        assert_eq!((&jobs[0].scene.shape, jobs[0].scene.every), (&vec![0.5], None));
        assert_eq!((&jobs[1].scene.shape, jobs[1].scene.every), (&vec![1.0], Some(1)));
        assert_eq!(jobs[1].scene.frames, "2..4".parse().ok());
    }

    #[test]
    fn a_garment_may_come_with_hints() {
        let jobs = read_text(
            "[[outfit]]\ngarments = [{ file = \"tee.obj\", unit = \"cm\", keep = \"outer\", material = { mu = 9.0 } }, \"coat\"]\nmotion = \"walk.npz\"\n",
        )
        .unwrap();
        let [tee, coat] = &jobs[0].garments[..] else { panic!("{jobs:?}") };
        assert!(tee.name.ends_with("/tee.obj"));
        assert_eq!((tee.hints.unit, tee.hints.keep), (Some(Unit::Cm), Keep::Outer));
        assert_eq!(coat.hints, FitSettings::default());
        assert_eq!((tee.material.mu, tee.material.density), (Some(9.0), Some(300.0)));
        assert_eq!(coat.material.density, Some(300.0));
    }

    #[test]
    fn only_outfits_in_motion_take_frames_from_the_command_line() {
        let entry = |more: &str| format!("[[outfit]]\ngarments = [\"coat\"]\n{more}\n");
        let text = ["motion = \"walk.npz\"", "pose = \"walk.npz:3\"", ""].map(entry).concat();
        let jobs = read_text(&text).unwrap();
        assert_eq!(jobs.iter().map(|job| job.scene.every).collect::<Vec<_>>(), [Some(3), None, None]);
        let message = read_text(&entry("pose = \"walk.npz:3\"\nevery = 2")).unwrap_err();
        assert!(message.contains("frames of no motion"), "{message}");
    }

    #[test]
    fn names_are_those_of_visible_folders_that_every_system_can_make() {
        for good in ["monday", "a.b", "tee + coat", "Mäntel", " x"] {
            assert!(is_folder_name(good), "{good:?}");
        }
        for bad in
            ["", " ", ".", "..", ".hidden", "a.", "a ", "a/b", "a\\b", "report.json", "Report.JSON", "a\n"]
        {
            assert!(!is_folder_name(bad), "{bad:?}");
        }
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
            ("[[outfit]]\ngarments = [3]\n", "garment 1: it is of type integer"),
            ("[[outfit]]\ngarments = [{ unit = \"cm\" }]\n", "file"),
            ("[[outfit]]\ngarments = [{ file = \"a\", size = 4 }]\n", "size"),
            ("[[outfit]]\ngarments = [\"b\", { file = \"a\", unit = \"ell\" }]\n", "garment 2: unit: 'ell'"),
            (
                "[[outfit]]\ngarments = [{ file = \"a\", material = { thickness = 3.0 } }]\n",
                "garment 1: material.thickness",
            ),
            ("outfit = []\n", "no outfit"),
            ("[[outfit]]\ngarments = [\"a\"]\n", "no outfit of"),
        ] {
            let message = read_text(text).unwrap_err();
            assert!(message.contains(part) && message.contains("outfits.toml"), "{message}");
        }
    }
}
