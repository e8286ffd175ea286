//! `info.mat` of a CLOTH3D sample.

use crate::asset::Pose;
use crate::asset::skeleton::BODY_JOINT_COUNT;
use crate::format::{MatFile, MatValue};
use std::path::Path;

/// Gender of a sample's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gender {
    /// 0 in the file.
    Female,
    /// 1 in the file.
    Male,
}

impl Gender {
    /// `female` or `male`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Female => "female",
            Self::Male => "male",
        }
    }
}

/// One garment of a sample's outfit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutfitItem {
    /// Name of the garment and of its files.
    pub name: String,
    /// cotton, silk, denim or leather; empty if not stated.
    pub fabric: String,
}

/// What `info.mat` says.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleInfo {
    /// The 22 body joints in every frame, in the file's z-up world.
    pub poses: Vec<Pose>,
    /// SMPL shape numbers.
    pub shape: Vec<f64>,
    /// Gender.
    pub gender: Gender,
    /// Turn about the vertical axis that the rest garments carry (rad).
    pub zrot: f64,
    /// The garments.
    pub outfit: Vec<OutfitItem>,
}

/// Numbers of one SMPL pose: 24 joints.
const POSE: usize = 72;

impl SampleInfo {
    /// Reads the file.
    ///
    /// # Errors
    /// A sentence that names the file and the variable.
    pub fn load(path: &Path) -> Result<Self, String> {
        let file = MatFile::load(path).map_err(|e| e.to_string())?;
        Self::from_mat(&file).map_err(|reason| format!("{}: {reason}", path.display()))
    }

    fn from_mat(file: &MatFile) -> Result<Self, String> {
        let poses = poses(file)?;
        let gender = match scalar(file, "gender")? {
            0.0 => Gender::Female,
            1.0 => Gender::Male,
            other => return Err(format!("gender is {other}, expected 0 (female) or 1 (male)")),
        };
        let outfit = match variable(file, "outfit")?.fields() {
            Some(fields) => fields.iter().map(|(name, value)| item(name, value)).collect::<Result<_, _>>()?,
            None => {
                return Err(format!(
                    "outfit is {}, expected a structure",
                    variable(file, "outfit")?.describe()
                ));
            }
        };
        let (shape, zrot) = (numbers(file, "shape")?.1, scalar(file, "zrot")?);
        Ok(Self { poses, shape, gender, zrot, outfit })
    }
}

fn item(name: &str, value: &MatValue) -> Result<OutfitItem, String> {
    // The name becomes part of a path.
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        return Err(format!("outfit names a garment '{}'", name.escape_default()));
    }
    let fabric = match value.field("fabric") {
        Some(MatValue::Text(fabric)) => fabric.trim().to_string(),
        _ => String::new(),
    };
    Ok(OutfitItem { name: name.into(), fabric })
}

fn variable<'a>(file: &'a MatFile, name: &str) -> Result<&'a MatValue, String> {
    file.get(name).ok_or_else(|| {
        let present: Vec<&str> = file.variables.iter().map(|(n, _)| n.as_str()).collect();
        format!(
            "no variable '{name}'; a sample has poses, shape, gender, zrot and outfit; present: {}",
            present.join(", ")
        )
    })
}

/// Shape and finite values.
fn numbers(file: &MatFile, name: &str) -> Result<(Vec<usize>, Vec<f64>), String> {
    match variable(file, name)? {
        MatValue::Numbers(array) => match array.data.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(format!("{name} holds a non-finite number at position {at}")),
            None => Ok((array.shape.clone(), array.data.clone())),
        },
        other => Err(format!("{name} is {}, expected numbers", other.describe())),
    }
}

fn scalar(file: &MatFile, name: &str) -> Result<f64, String> {
    match &numbers(file, name)?.1[..] {
        [x] => Ok(*x),
        many => Err(format!("{name} has {} numbers, expected one", many.len())),
    }
}

fn poses(file: &MatFile) -> Result<Vec<Pose>, String> {
    let (shape, data) = numbers(file, "poses")?;
    // (72, N) column per frame; a single frame is saved as (72,), which MATLAB knows as (1, 72).
    let (frames, stride) = match shape[..] {
        [POSE, frames] => (frames, frames),
        [1, POSE] => (1, 1),
        _ => return Err(format!("poses has shape {shape:?}, expected [{POSE}, frames]")),
    };
    if frames == 0 {
        return Err("poses has no frames".into());
    }
    let joint = |frame: usize, j: usize| std::array::from_fn(|a| data[(3 * j + a) * stride + frame]);
    Ok((0..frames)
        .map(|frame| Pose { rotations: (0..BODY_JOINT_COUNT).map(|j| joint(frame, j)).collect() })
        .collect())
}
