//! CLOTH3D and CLOTH3D++ sample folders: garments on the zero body, and poses as motions.
//!
//! Bertiche et al., "CLOTH3D: Clothed 3D Humans", 2020. A folder holds `info.mat`, a rest mesh `<Garment>.obj` for
//! every key of its `outfit`, and the simulated vertices `<Garment>.pc16`, which are not read. The rest meshes stand in a z-up world,
//! turned by `zrot`, on an SMPL body of the sample's gender and shape with its legs apart and its root joint at the
//! origin; here they are brought to the zero body in T-pose.

mod info;
mod unpose;

pub use info::{Gender, OutfitItem, SampleInfo};
pub use unpose::{Unposing, upright};

use super::motions::{NamedFile, named, write_motions};
use super::overwrite::refuse_overwriting;
use super::summary::{ImportError, Progress, Summary};
use super::thinning::{Thinned, Thinning, thin};
use super::up_axis::WorldUp;
use crate::asset::{BindingSettings, Body, Category, Garment, Motion, Provenance};
use crate::folders::save_garment_folder;
use crate::format::{FileError, folder, obj};
use crate::mesh::contact;
use clothcombo_physics::query::Surface;
use std::fs;
use std::path::{Path, PathBuf};

/// The bodies involved: SMPL or SMPL-H, because the samples' shape numbers are SMPL's.
#[derive(Clone, Copy, Debug)]
pub struct Cloth3dBodies<'a> {
    /// The body the garments are for; they end on its zero body.
    pub target: &'a Body,
    /// The body of female samples; the target, if there is none.
    pub female: Option<&'a Body>,
    /// The body of male samples; the target, if there is none.
    pub male: Option<&'a Body>,
}

/// How samples are imported.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloth3dSettings {
    /// How garments are bound to the body for being unposed.
    pub binding: BindingSettings,
    /// Which frames of the motions are kept.
    pub thinning: Thinning,
    /// The files that the bodies came from: folders with one of them are not written to.
    pub body_files: Vec<PathBuf>,
}

impl Default for Cloth3dSettings {
    fn default() -> Self {
        let thinning = Thinning { frame_rate: FRAME_RATE, static_threshold: 0.5f64.to_radians() };
        Self { binding: BindingSettings::default(), thinning, body_files: Vec::new() }
    }
}

/// Of the simulations (frames/s).
const FRAME_RATE: f64 = 30.0;

/// Imports samples to `out`: `garments/*.obj` with `garments.toml`, and `motions/*.npz`. `inputs` are sample
/// folders, or folders of them.
///
/// # Errors
/// [`ImportError`] if there is no sample, none of its garments can be used, or a result cannot be written.
pub fn import_cloth3d(
    inputs: &[PathBuf],
    bodies: &Cloth3dBodies<'_>,
    out: &Path,
    settings: &Cloth3dSettings,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    let target = bodies.target;
    for body in bodies.female.iter().chain(&bodies.male) {
        if body.vertex_count() != target.vertex_count() || body.faces != target.faces {
            return Err(ImportError::Refused(format!(
                "body '{}' is not the same mesh as body '{}'; give the files of one model, for example three of SMPL's",
                body.name, target.name
            )));
        }
    }
    let samples = find_samples(inputs)?;
    if samples.is_empty() {
        let inputs: Vec<String> = inputs.iter().map(|i| i.display().to_string()).collect();
        return Err(ImportError::Refused(format!(
            "{}: no CLOTH3D sample; a sample folder holds info.mat",
            inputs.join(", ")
        )));
    }
    // Inputs lie in the samples' folders, results in these: none meet unless the folders do.
    let outputs = ["garments", "motions"].map(|folder| out.join(folder));
    // A file that is named without its folder lies in one, too.
    let folder = |file: &PathBuf| fs::canonicalize(file).ok()?.parent().map(Path::to_path_buf);
    let of_bodies = settings.body_files.iter().filter_map(folder);
    refuse_overwriting(samples.iter().map(|sample| sample.path.clone()).chain(of_bodies), outputs)?;
    let mut summary = Summary { notes: assumptions(bodies), ..Summary::default() };
    let surface = Surface::new(target.template.clone(), target.faces.clone());
    let (mut garments, mut clips) = (Vec::new(), Vec::new());
    for (done, sample) in samples.iter().enumerate() {
        progress("unposing garments", done, samples.len());
        match import_sample(sample, bodies, &surface, settings, &mut garments, &mut summary) {
            Ok(()) => clips.push(NamedFile { path: sample.path.join("info.mat"), name: sample.name.clone() }),
            Err(reason) => summary.skipped.push((sample.path.display().to_string(), reason)),
        }
    }
    progress("unposing garments", samples.len(), samples.len());
    if garments.is_empty() {
        let (first, reason) = summary.skipped.first().cloned().unwrap_or_default();
        return Err(ImportError::Refused(format!(
            "no garment of {} samples could be used; the first, {first}: {reason}",
            samples.len()
        )));
    }
    summary.written.extend(save_garment_folder(&out.join("garments"), &garments)?);
    let import = |path: &Path| motion(path, settings);
    let motions = write_motions(&clips, None, &out.join("motions"), "info.mat files", &import, progress)?;
    summary.taken.extend(motions.taken.into_iter().map(|(name, note)| (format!("motion {name}"), note)));
    summary.skipped.extend(motions.skipped);
    summary.notes.extend(motions.notes);
    summary.written.extend(motions.written);
    Ok(summary)
}

/// What is taken for granted about the bodies, in words.
fn assumptions(bodies: &Cloth3dBodies<'_>) -> Vec<String> {
    let target = bodies.target;
    let mut notes =
        vec![format!("garments lie on the zero body '{}' in T-pose, pelvis at the origin", target.name)];
    for (gender, body) in [("female", bodies.female), ("male", bodies.male)] {
        notes.push(match body {
            Some(body) => format!("{gender} samples were unposed with body '{}'", body.name),
            None => format!(
                "{gender} samples were unposed with the target body itself; --{gender} FILE with the SMPL model of that gender is \
                 more exact"
            ),
        });
    }
    if !has_smpl_shape(target) {
        notes.push(format!(
            "the samples' shape numbers are SMPL's and mean nothing to body '{}' ({} joints): they were not applied, so garments \
             may stand off or cut in by centimetres",
            target.name,
            target.joint_count()
        ));
    }
    notes
}

/// SMPL and SMPL-H share their shape space.
fn has_smpl_shape(body: &Body) -> bool {
    matches!(body.joint_count(), 24 | 52)
}

fn find_samples(inputs: &[PathBuf]) -> Result<Vec<NamedFile>, FileError> {
    let is_sample = |folder: &PathBuf| folder.join("info.mat").is_file();
    let mut samples = Vec::new();
    for input in inputs {
        match is_sample(input) {
            true => samples.push(input.clone()),
            false => samples.extend(folder::entries(input)?.into_iter().filter(is_sample)),
        }
    }
    Ok(named(samples.into_iter().map(|folder| {
        let full = fs::canonicalize(&folder).unwrap_or_else(|_| folder.clone());
        let name = full.file_name().map_or_else(|| "sample".into(), |n| n.to_string_lossy().into_owned());
        (folder, name)
    })))
}

/// The garments of one sample; the error is the reason to skip it as a whole.
fn import_sample(
    sample: &NamedFile,
    bodies: &Cloth3dBodies<'_>,
    surface: &Surface<f64>,
    settings: &Cloth3dSettings,
    garments: &mut Vec<Garment>,
    summary: &mut Summary,
) -> Result<(), String> {
    let info = SampleInfo::load(&sample.path.join("info.mat"))?;
    let of_gender = match info.gender {
        Gender::Female => bodies.female,
        Gender::Male => bodies.male,
    };
    let body = of_gender.unwrap_or(bodies.target);
    let known = if has_smpl_shape(body) { info.shape.len().min(body.shape_count) } else { 0 };
    let unposing = Unposing::new(body, &info.shape[..known], bodies.target)?;
    for item in &info.outfit {
        let mesh_path = sample.path.join(format!("{}.obj", item.name));
        match unposed_garment(sample, &info, item, &mesh_path, &unposing, bodies.target, settings) {
            Ok(garment) => {
                let inside = contact(garment.rest.positions(), surface).inside;
                summary.taken.push((garment.name.clone(), about(&garment, item, inside)));
                garments.push(garment);
            }
            Err(reason) => summary.skipped.push((mesh_path.display().to_string(), reason)),
        }
    }
    Ok(())
}

fn about(garment: &Garment, item: &OutfitItem, inside: usize) -> String {
    let fabric = if item.fabric.is_empty() { "fabric not stated" } else { &item.fabric };
    format!(
        "{}, {} vertices, {} triangles, {fabric}, {inside} vertices inside the body",
        garment.category,
        garment.rest.vertex_count(),
        garment.rest.face_count()
    )
}

fn unposed_garment(
    sample: &NamedFile,
    info: &SampleInfo,
    item: &OutfitItem,
    path: &Path,
    unposing: &Unposing,
    target: &Body,
    settings: &Cloth3dSettings,
) -> Result<Garment, String> {
    let mesh = obj::load(path).map_err(|e| e.to_string())?;
    let mut positions = mesh.positions().to_vec();
    upright(&mut positions, info.zrot);
    let mesh = mesh.with_positions(positions).map_err(|e| e.to_string())?;
    let category = category(&item.name).unwrap_or_else(|| Category::guess(&mesh, target));
    let positions = unposing.apply(&mesh, category, &settings.binding)?;
    let rest = mesh.with_positions(positions).map_err(|e| e.to_string())?;
    // Shirts that open in front have no name of their own.
    let category = match category {
        Category::Top | Category::TShirt if Category::guess(&rest, target) == Category::OpenShirt => {
            Category::OpenShirt
        }
        known => known,
    };
    let name = format!("{}_{}", sample.name, item.name);
    let source = provenance(&format!("{}, {}", sample.name, item.name));
    let holding = Garment::needs_holding(&rest, target);
    Ok(Garment { name, holding, source, ..Garment::new(category, rest) })
}

fn category(name: &str) -> Option<Category> {
    Some(match name.to_ascii_lowercase().as_str() {
        "top" => Category::Top,
        "tshirt" | "t-shirt" | "t_shirt" => Category::TShirt,
        "openshirt" | "open_shirt" => Category::OpenShirt,
        "trousers" | "jumpsuit" => Category::Trousers,
        "skirt" => Category::Skirt,
        "dress" => Category::Dress,
        _ => return None,
    })
}

fn provenance(what: &str) -> Provenance {
    Provenance {
        source: format!("CLOTH3D sample {what}"),
        author: "Bertiche, Madadi, Escalera (CLOTH3D)".into(),
        licence: "CLOTH3D terms of use (non-commercial research)".into(),
    }
}

/// The poses of a sample as a motion.
fn motion(info_mat: &Path, settings: &Cloth3dSettings) -> Result<(Motion, String), String> {
    let info = SampleInfo::load(info_mat)?;
    let mut poses = info.poses;
    poses.iter_mut().for_each(|pose| WorldUp::Z.turn_root_to_y_up(pose));
    let Thinned { poses, frame_rate, note } = thin(poses, FRAME_RATE, &settings.thinning);
    let folder = info_mat.parent().and_then(Path::file_name).map(|f| f.to_string_lossy().into_owned());
    let source = provenance(&folder.unwrap_or_default());
    let motion = Motion { name: String::new(), frame_rate, poses, source };
    Ok((motion, format!("{}, {note}", info.gender.name())))
}
