//! The layouts in which public tools write SMPL poses as npz: which keys hold the rotations and the frame rate.
//!
//! | written by | keys |
//! |---|---|
//! | AMASS, SOMA | `poses` (N, 66 to 165), `mocap_framerate` or `mocap_frame_rate` |
//! | AIST++ | `smpl_poses` (N, 72), no rate |
//! | SMPLify-X, WHAM, SLAHMR | `global_orient`, `body_pose` (N, 63 or 69) |
//! | 4D-Humans | the same as rotation matrices (N, J, 3, 3) |
//! | EasyMocap | `Rh`, and `poses` without a root rotation |
//! | SMPL-X in one array | `full_pose` |
//!
//! Every array may be (N, 3J) or (N, J, 3) axis-angle, or (N, J, 3, 3) matrices.

use crate::asset::pose::Pose;
use crate::asset::rotation::{Matrix3, axis_angle_from_matrix};
use crate::asset::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_NAMES};
use crate::format::{FileError, NpzFile};
use std::path::{Path, PathBuf};

const MOTION_HINT: &str =
    "a motion has poses (frames, 66 or more) and mocap_framerate, or the keys of another SMPL tool";

/// Keys of arrays that hold root and joints.
const ALL_JOINTS: [&str; 4] = ["poses", "full_pose", "fullpose", "smpl_poses"];
/// Keys of arrays that hold the joints without the root.
const WITHOUT_ROOT: [&str; 2] = ["body_pose", "pose_body"];
/// Keys of the root's rotation.
const ROOT_KEYS: [&str; 3] = ["global_orient", "root_orient", "Rh"];
/// Numbers of joints without the root, of SMPL-X and of SMPL.
const BODY_WITHOUT_ROOT: [usize; 2] = [21, 23];
/// Numbers of joints, the root among them, of SMPL, SMPL-H and SMPL-X, with and without hands, jaw and eyes.
const KNOWN_JOINTS: [usize; 8] = [22, 23, 24, 25, 52, 53, 54, 55];
/// Keys of the frame rate (frames/s).
const RATE_KEYS: [&str; 6] =
    ["mocap_framerate", "mocap_frame_rate", "fps", "framerate", "frame_rate", "rate"];
/// Two rates whose ratio is this near to 1 are one rate: 29.97 is no 30, 120.00005 is 120.
const SAME_RATE: f64 = 5e-4;

/// What a motion file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionFile {
    /// The file.
    pub path: PathBuf,
    /// One pose of the 22 body joints per frame.
    pub poses: Vec<Pose>,
    /// Key and value of the frame rate (frames/s), where the file has one.
    pub rate: Option<(&'static str, f64)>,
    /// Keys that the poses come from.
    pub keys: String,
    /// Joints in the file, the root among them.
    pub joints: usize,
    /// Arrays that are Python pickles; they are not read.
    pub pickled: Vec<String>,
}

/// Whether `file` has a key that holds poses.
pub(crate) fn holds_poses(file: &NpzFile) -> bool {
    ALL_JOINTS.iter().chain(&WITHOUT_ROOT).any(|key| file.contains(key))
}

impl MotionFile {
    /// Reads the rotations and the frame rate. Of more than 22 joints those of the body are kept: those that `joint_names` says,
    /// or else the first.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let mut file = NpzFile::open(path)?;
        let Rotations { joints, values, keys } = rotations(&mut file)?;
        // Names that are no text (pickled ones), as none at all, say nothing.
        let names = file.texts("joint_names")?.unwrap_or_default();
        if names.is_empty() && !KNOWN_JOINTS.contains(&joints) {
            return Err(FileError::content(path)(format!(
                "key '{keys}' has {joints} joints of three numbers; SMPL has 24, SMPL-H 52, SMPL-X 55, without hands 22. Are these \
                 quaternions, matrices or 6D rotations, or is the array transposed? Write axis-angle, or say the joints in 'joint_names'"
            )));
        }
        let places = places(&names, joints).map_err(|joint| {
            FileError::content(path)(format!(
                "key 'joint_names' names no '{joint}'; the 22 joints of the body are named as in SMPL, in any order"
            ))
        })?;
        let pose = |row: &[[f64; 3]]| Pose { rotations: places.map(|place| row[place]).to_vec() };
        let poses = values.chunks_exact(joints).map(pose).collect();
        let pickled = file.keys().into_iter().filter(|key| file.is_pickled(key)).collect();
        Ok(Self { path: path.into(), poses, rate: rate(&mut file)?, keys, joints, pickled })
    }

    /// The frame rate (frames/s): the file's own, or `given` where it has none.
    ///
    /// # Errors
    /// If there is none, or `given` is another one than the file's.
    pub fn frame_rate(&self, given: Option<f64>) -> Result<f64, String> {
        match (self.rate, given) {
            (Some((_, own)), None) => Ok(own),
            (None, Some(given)) => Ok(given),
            (Some((key, own)), Some(given)) if !is_same_rate(own, given) => Err(format!(
                "key '{key}' says {own} frames per second, --rate {given}; --rate is for files without a rate: leave it out"
            )),
            (Some((_, own)), Some(_)) => Ok(own),
            (None, None) => Err(format!(
                "no frame rate: none of the keys {} is there; say it with `clothcombo import amass FILE --rate HZ -o FOLDER`",
                RATE_KEYS.join(", ")
            )),
        }
    }
}

fn is_same_rate(a: f64, b: f64) -> bool {
    a == b || (a / b - 1.0).abs() < SAME_RATE
}

/// Rotations of all joints of all frames, frame by frame, the root first.
struct Rotations {
    joints: usize,
    values: Vec<[f64; 3]>,
    keys: String,
}

fn rotations(file: &mut NpzFile) -> Result<Rotations, FileError> {
    let root = ROOT_KEYS.into_iter().find(|key| file.contains(key));
    let body = ALL_JOINTS.into_iter().chain(WITHOUT_ROOT).find(|key| file.contains(key));
    // Without any of them the message names the most common one.
    let body = body.unwrap_or(ALL_JOINTS[0]);
    let (joints, values) = read_joints(file, body, false)?;
    let is_body_alone = root.is_some() && BODY_WITHOUT_ROOT.contains(&joints);
    let has_root = ALL_JOINTS.contains(&body) && joints >= BODY_JOINT_COUNT && !is_body_alone;
    if has_root {
        // EasyMocap leaves the root at rest and writes its turn beside it.
        let at_rest = values.chunks_exact(joints).all(|row| row[0] == [0.0; 3]);
        return match root.filter(|_| at_rest) {
            None => Ok(Rotations { joints, values, keys: body.into() }),
            Some(key) => with_root(file, key, body, (joints, values), 1),
        };
    }
    match root {
        Some(key) if is_body_alone => with_root(file, key, body, (joints, values), 0),
        None if BODY_WITHOUT_ROOT.contains(&joints) && !ALL_JOINTS.contains(&body) => {
            Err(FileError::content(file.path())(format!(
                "key '{body}' holds the joints without the root, and none of the keys {} of the root's rotation is there",
                ROOT_KEYS.join(", ")
            )))
        }
        _ => {
            let expected = match ALL_JOINTS.contains(&body) {
                true => {
                    "[frames, 66 or more, three for each joint], or [frames, joints, 3] of 22 joints or more"
                }
                false => "[frames, 63 or 69], or [frames, 21 or 23, 3]",
            };
            let shape = file.shape(body)?;
            Err(file.wrong_shape(body, &shape, expected))
        }
    }
}

/// The rotations of `body`, with those of the root in place of the first `replaced` joints of every frame.
fn with_root(
    file: &mut NpzFile,
    root: &str,
    body: &str,
    (joints, values): (usize, Vec<[f64; 3]>),
    replaced: usize,
) -> Result<Rotations, FileError> {
    let (count, turns) = read_joints(file, root, true)?;
    let (frames, found) = (values.len() / joints, turns.len() / count.max(1));
    if count != 1 || found != frames {
        return Err(FileError::content(file.path())(format!(
            "key '{root}' has {found} frames of {count} rotations, key '{body}' {frames} frames; expected one rotation for each \
             frame"
        )));
    }
    let rows = values.chunks_exact(joints).zip(turns);
    let values = rows.flat_map(|(row, turn)| std::iter::once(turn).chain(row[replaced..].iter().copied()));
    Ok(Rotations {
        joints: joints + 1 - replaced,
        values: values.collect(),
        keys: format!("{root} + {body}"),
    })
}

/// Joints per frame and all rotations (axis-angle, rad) of an array; (N, 3, 3) are matrices if it `is_root`.
fn read_joints(file: &mut NpzFile, key: &str, is_root: bool) -> Result<(usize, Vec<[f64; 3]>), FileError> {
    let array = file.numbers(key, MOTION_HINT)?;
    let vectors = || array.data.chunks_exact(3).map(|r| [r[0], r[1], r[2]]).collect();
    match array.shape[..] {
        [_, 3, 3] if is_root => Ok((1, axis_angles(file, key, 1, &array.data)?)),
        [_, joints, 3, 3] if joints > 0 => Ok((joints, axis_angles(file, key, joints, &array.data)?)),
        [_, joints, 3] if joints > 0 => Ok((joints, vectors())),
        [_, columns] if columns > 0 && columns % 3 == 0 => Ok((columns / 3, vectors())),
        _ => {
            let expected = "[frames, 66 or more, three for each joint], or [frames, joints, 3]";
            Err(file.wrong_shape(key, &array.shape, if is_root { "[frames, 3]" } else { expected }))
        }
    }
}

/// Rotation matrices as axis-angle vectors.
fn axis_angles(file: &NpzFile, key: &str, joints: usize, data: &[f64]) -> Result<Vec<[f64; 3]>, FileError> {
    let one = |(i, m): (usize, &[f64])| {
        let m: Matrix3 = std::array::from_fn(|r| std::array::from_fn(|c| m[3 * r + c]));
        // Also false for numbers that are not finite.
        if is_rotation(&m) {
            return Ok(axis_angle_from_matrix(&m));
        }
        Err(FileError::content(file.path())(format!(
            "key '{key}', frame {}, joint {} is no rotation matrix: {m:?}",
            i / joints,
            i % joints
        )))
    };
    data.chunks_exact(9).enumerate().map(one).collect()
}

fn is_rotation(m: &Matrix3) -> bool {
    let dot = |a: usize, b: usize| (0..3).map(|k| m[a][k] * m[b][k]).sum::<f64>();
    let orthonormal = (0..3).all(|a| (0..3).all(|b| (dot(a, b) - f64::from(u8::from(a == b))).abs() < 1e-2));
    let [x, y, z] = *m;
    let determinant = x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0])
        + x[2] * (y[0] * z[1] - y[1] * z[0]);
    orthonormal && determinant > 0.0
}

/// The frame rate and its key; a scalar, or an array of equal numbers.
fn rate(file: &mut NpzFile) -> Result<Option<(&'static str, f64)>, FileError> {
    let mut found: Option<(&'static str, f64)> = None;
    for key in RATE_KEYS.into_iter().filter(|key| file.contains(key)).collect::<Vec<_>>() {
        let values = file.numbers(key, MOTION_HINT)?.data;
        let Some(&value) = values.first() else {
            return Err(FileError::content(file.path())(format!("key '{key}' is an empty array")));
        };
        if let Some(other) = values.iter().find(|other| !is_same_rate(**other, value) && !value.is_nan()) {
            return Err(FileError::content(file.path())(format!(
                "key '{key}' holds several frame rates, {value} and {other}; a motion has one"
            )));
        }
        match found {
            Some((first, rate)) if !is_same_rate(rate, value) => {
                return Err(FileError::content(file.path())(format!(
                    "key '{first}' says {rate} frames per second, key '{key}' {value}; remove the wrong one"
                )));
            }
            Some(_) => (),
            None => found = Some((key, value)),
        }
    }
    Ok(found)
}

/// Where the joints of the body are among those called `names`, of which there must be `count`. Names that are all
/// unknown, or too few or many, say nothing: the order is SMPL's.
fn places(names: &[String], count: usize) -> Result<[usize; BODY_JOINT_COUNT], &'static str> {
    let own = BODY_JOINT_NAMES.map(|joint| names.iter().position(|name| name == joint));
    if names.len() != count || own.iter().all(Option::is_none) {
        return Ok(std::array::from_fn(|joint| joint));
    }
    match own.iter().position(Option::is_none) {
        Some(missing) => Err(BODY_JOINT_NAMES[missing]),
        None => Ok(own.map(Option::unwrap_or_default)),
    }
}

#[cfg(test)]
mod tests;
