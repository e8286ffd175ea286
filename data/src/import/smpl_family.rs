//! SMPL, SMPL-H and SMPL-X model files (npz) as bodies.
//!
//! The reading is [`Body::load`]'s; here the model is recognised, and said what was taken, what was left out and why.

use super::overwrite::refuse_overwriting;
use super::summary::{ImportError, Progress, Summary};
use crate::asset::body_file::{BodyFileSettings, INSIDE_OUT, shape_part};
use crate::asset::{Body, Provenance};
use crate::format::{FileError, NpzFile, folder, way_out};
use std::path::{Path, PathBuf};

fn hint(models: &[PathBuf]) -> String {
    if models.is_empty() {
        return " (there is no .npz in it)".into();
    }
    let shown: Vec<String> = models.iter().map(|m| m.display().to_string()).collect();
    format!(": {}", shown.join(", "))
}

/// A published model: its vertex and joint counts.
struct PublishedModel {
    name: &'static str,
    vertices: usize,
    joints: usize,
    reference: &'static str,
    licence: &'static str,
}

const MODELS: [PublishedModel; 3] = [
    PublishedModel {
        name: "SMPL",
        vertices: 6890,
        joints: 24,
        reference: "Loper et al. 2015, Max Planck Institute for Intelligent Systems",
        licence: "SMPL model licence; see https://smpl.is.tue.mpg.de",
    },
    PublishedModel {
        name: "SMPL-H",
        vertices: 6890,
        joints: 52,
        reference: "Romero et al. 2017, Max Planck Institute for Intelligent Systems",
        licence: "MANO/SMPL-H model licence (non-commercial); see https://mano.is.tue.mpg.de",
    },
    PublishedModel {
        name: "SMPL-X",
        vertices: 10475,
        joints: 55,
        reference: "Pavlakos et al. 2019, Max Planck Institute for Intelligent Systems",
        licence: "SMPL-X model licence (non-commercial); see https://smpl-x.is.tue.mpg.de",
    },
];

/// The arrays a body is made of.
const TAKEN: [&str; 14] = [
    "v_template",
    "f",
    "shapedirs",
    "posedirs",
    "weights",
    "kintree_table",
    "J_regressor",
    "J_template",
    "J_shapedirs",
    "joint_names",
    "pelvis_template",
    "pelvis_shapedirs",
    "source",
    "author",
];

/// Imports one SMPL, SMPL-H or SMPL-X npz as the body npz `out`, with at most `settings.shape_components` shape components.
///
/// # Errors
/// [`ImportError`] naming file and key.
pub fn import_smpl_family(
    input: &Path,
    out: &Path,
    settings: &BodyFileSettings,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    refuse_what_is_no_npz(input)?;
    refuse_overwriting([input], [out])?;
    progress("reading the model", 0, 2);
    let (body, was_inside_out) = Body::read_turned(NpzFile::open(input)?, settings)?;
    let mut file = NpzFile::open(input)?;
    let model = MODELS.iter().find(|m| (m.vertices, m.joints) == (body.vertex_count(), body.joint_count()));
    let provenance = provenance(&mut file, model, input);
    progress("writing the body", 1, 2);
    body.save(out, &provenance)?;
    progress("writing the body", 2, 2);

    let mut summary = Summary { written: vec![out.into()], ..Summary::default() };
    let correctives = if body.pose_directions.is_some() { "with" } else { "without" };
    summary.taken.push((
        input.display().to_string(),
        format!(
            "{}, {} vertices, {} triangles, {} joints, {} shape components, {correctives} pose correctives, licence: {}",
            model.map_or("a body of no published size", |m| m.name),
            body.vertex_count(),
            body.faces.len(),
            body.joint_count(),
            body.shape_count,
            if provenance.licence.is_empty() { "not stated in the file" } else { &provenance.licence }
        ),
    ));
    for key in file.keys() {
        if file.is_pickled(&key) {
            summary.skipped.push((key, "an object array, that is, a Python pickle; never executed".into()));
        } else if !TAKEN.contains(&key.as_str()) && key != "licence" {
            summary.skipped.push((key, "not needed for the draped body".into()));
        }
    }
    if let Ok(directions) = file.shape("shapedirs") {
        let components = directions.last().copied().unwrap_or(0);
        let shape = shape_part(body.joint_count(), components, file.contains("J_shapedirs"));
        if shape < components {
            let note =
                format!("shapedirs {shape} to {} are facial expression and were left out", components - 1);
            summary.notes.push(note);
        }
        if body.shape_count < shape {
            let note = format!("{} of {shape} shape components kept (--components)", body.shape_count);
            summary.notes.push(note);
        }
    }
    if body.shape_count == 0 {
        summary
            .notes
            .push("the body has no shape space: it is draped and trained on in its one shape".into());
    }
    if was_inside_out {
        summary.notes.push(INSIDE_OUT.into());
    }
    if let Some(reason) = body.implausibility() {
        summary.notes.push(format!("no garment can be fitted to it, and training refuses it: {reason}"));
    }
    summary.notes.push(format!(
        "the pelvis joint was moved to the origin for every shape{}; hands rest flat",
        if file.contains("J_shapedirs") { "" } else { ", joints come from J_regressor" }
    ));
    Ok(summary)
}

fn refuse_what_is_no_npz(input: &Path) -> Result<(), FileError> {
    if input.is_dir() {
        let mut models = Vec::new();
        for path in std::fs::read_dir(input).into_iter().flatten().flatten().map(|entry| entry.path()) {
            // SMPL-H ships as {male,female,neutral}/model.npz.
            let inner = path.join("model.npz");
            if folder::has_extension(&path, "npz") {
                models.push(path);
            } else if inner.is_file() {
                models.push(inner);
            }
        }
        models.sort();
        let message = format!("this is a folder; name one model file in it{}", hint(&models));
        return Err(FileError::content(input)(message));
    }
    match way_out(input).filter(|_| input.is_file()) {
        Some(way_out) => Err(FileError::content(input)(way_out)),
        None => Ok(()),
    }
}

/// What the file says itself, or what is known of the published model.
fn provenance(file: &mut NpzFile, model: Option<&PublishedModel>, input: &Path) -> Provenance {
    let own = Provenance::read(file);
    if own != Provenance::default() {
        return own;
    }
    let name = input.file_name().unwrap_or_default().to_string_lossy();
    // SMPL-H files are all called model.npz; their folder says whose they are.
    let folder = input.parent().and_then(Path::file_name).map(|f| f.to_string_lossy().into_owned());
    let name =
        if name == "model.npz" { format!("{}/{name}", folder.unwrap_or_default()) } else { name.into() };
    match model {
        Some(m) => Provenance {
            source: format!("{} model, {name}", m.name),
            author: m.reference.into(),
            licence: m.licence.into(),
        },
        None => Provenance { source: name, ..Provenance::default() },
    }
}
