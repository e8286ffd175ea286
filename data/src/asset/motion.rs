//! A clip of poses and its npz file: `poses` (N, 66) axis-angle of the 22 body joints, `mocap_framerate`, `joint_names`,
//! `source`, `author`, `licence`. AMASS files (more columns, other spelling of the rate) are read as well.

use super::pose::Pose;
use super::provenance::Provenance;
use super::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_NAMES};
use crate::format::npz::{NpzError, NpzFile, NpzWriter};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a motion file cannot be used.
#[derive(Debug, Error)]
pub enum MotionError {
    /// The archive or one of its arrays is unusable.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// A frame holds a NaN or infinite angle.
    #[error("{}: frame {frame}, joint {joint} has a non-finite rotation", path.display())]
    NonFinite {
        /// The file.
        path: PathBuf,
        /// The frame, from 0.
        frame: usize,
        /// The joint.
        joint: usize,
    },
    /// The frame rate is not a positive number.
    #[error("{}: key '{key}' is {value}, expected frames per second > 0", path.display())]
    FrameRate {
        /// The file.
        path: PathBuf,
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
    },
}

/// A clip of motion: poses of the 22 body joints at a constant rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Name, unique within a dataset.
    pub name: String,
    /// Frames per second.
    pub frame_rate: f64,
    /// One pose of 22 joints per frame.
    pub poses: Vec<Pose>,
    /// Where it comes from.
    pub source: Provenance,
}

const HINT: &str = "a motion has poses (frames, 66 or more) and mocap_framerate";
const RATE_KEYS: [&str; 2] = ["mocap_framerate", "mocap_frame_rate"];

impl Motion {
    /// Reads a motion npz; of more than 22 joints the first 22 are kept.
    ///
    /// # Errors
    /// [`MotionError`] naming file, key or frame.
    pub fn load(path: &Path) -> Result<Self, MotionError> {
        Self::load_with_columns(path).map(|(motion, _)| motion)
    }

    /// As [`Self::load`], with the number of columns of `poses`, which tells the layouts apart.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_columns(path: &Path) -> Result<(Self, usize), MotionError> {
        let mut file = NpzFile::open(path)?;
        let poses = file.numbers("poses", HINT)?;
        let columns = match poses.shape[..] {
            [_, columns] if columns >= 3 * BODY_JOINT_COUNT => columns,
            _ => {
                let (key, found) = ("poses".into(), poses.shape);
                return Err(NpzError::Shape {
                    path: path.into(),
                    key,
                    found,
                    expected: "[frames, 66 or more]".into(),
                }
                .into());
            }
        };
        let key = if file.contains(RATE_KEYS[1]) { RATE_KEYS[1] } else { RATE_KEYS[0] };
        let frame_rate = file.numbers(key, HINT)?.data.first().copied().unwrap_or(f64::NAN);
        if !(frame_rate > 0.0 && frame_rate.is_finite()) {
            return Err(MotionError::FrameRate { path: path.into(), key, value: frame_rate });
        }
        let mut frames = Vec::with_capacity(poses.shape[0]);
        for (frame, row) in poses.data.chunks_exact(columns).enumerate() {
            let row = &row[..3 * BODY_JOINT_COUNT];
            if let Some(at) = row.iter().position(|x| !x.is_finite()) {
                return Err(MotionError::NonFinite { path: path.into(), frame, joint: at / 3 });
            }
            frames.push(Pose { rotations: row.chunks_exact(3).map(|r| [r[0], r[1], r[2]]).collect() });
        }
        let mut text = |key: &str| match file.strings(key, HINT) {
            Ok(array) => array.data.into_iter().next().unwrap_or_default(),
            Err(_) => String::new(),
        };
        let source = Provenance { source: text("source"), author: text("author"), licence: text("licence") };
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        Ok((Self { name, frame_rate, poses: frames, source }, columns))
    }

    /// Writes the motion npz.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), MotionError> {
        let rows: Vec<f32> = self
            .poses
            .iter()
            .flat_map(|pose| (0..BODY_JOINT_COUNT).flat_map(|j| pose.rotation(j)))
            .map(|x| x as f32)
            .collect();
        let mut npz = NpzWriter::new();
        npz.f32("poses", &[self.poses.len(), 3 * BODY_JOINT_COUNT], &rows)
            .f64("mocap_framerate", &[], &[self.frame_rate])
            .strings("joint_names", &[BODY_JOINT_COUNT], &BODY_JOINT_NAMES)
            .strings("source", &[], &[&self.source.source])
            .strings("author", &[], &[&self.source.author])
            .strings("licence", &[], &[&self.source.licence]);
        Ok(npz.save(path)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        let poses = (0..5).map(|f| Pose { rotations: vec![[0.125 * f as f64, -0.5, 0.25]; 22] }).collect();
        let source = Provenance { source: "a".into(), author: "Zoë".into(), licence: "MIT".into() };
        let motion = Motion { name: "clip".into(), frame_rate: 30.0, poses, source };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("clip.npz");
        motion.save(&path).unwrap();
        assert_eq!(Motion::load(&path).unwrap(), motion);
    }

    #[test]
    fn a_file_without_poses_or_with_nan_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shape.npz");
        let mut npz = NpzWriter::new();
        npz.f64("betas", &[2], &[0.0, 1.0]);
        npz.save(&path).unwrap();
        let message = Motion::load(&path).unwrap_err().to_string();
        assert!(
            message.contains("shape.npz") && message.contains("'poses'") && message.contains("betas"),
            "{message}"
        );

        let mut npz = NpzWriter::new();
        let mut rows = vec![0.0f32; 132];
        rows[66 + 7] = f32::NAN;
        npz.f32("poses", &[2, 66], &rows).f64("mocap_framerate", &[], &[30.0]);
        npz.save(&path).unwrap();
        let message = Motion::load(&path).unwrap_err().to_string();
        assert!(message.contains("frame 1, joint 2"), "{message}");
    }
}
