//! A clip of poses and its npz file: `poses` (N, 66) axis-angle of the 22 body joints, `mocap_framerate`, `joint_names`,
//! `source`, `author`, `licence`. The layouts of other SMPL tools are read as well.

mod layout;

pub use layout::MotionFile;
pub(crate) use layout::holds_poses;

use super::pose::Pose;
use super::provenance::Provenance;
use super::rotation::matrix_from_axis_angle;
use super::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_NAMES};
use crate::format::{FileError, NpzFile, NpzWriter};
use std::ops::RangeInclusive;
use std::path::Path;

/// Frame rates that a motion may have (frames/s): from time lapse to high-speed cameras. Beyond them times and numbers of frames
/// leave the range of their types.
pub const FRAME_RATES: RangeInclusive<f64> = 0.01..=10_000.0;

/// Largest component of a rotation vector in a motion (rad): over a thousand turns, where f32 still tells a thousandth
/// of a radian.
pub const MAX_ANGLE: f64 = 1e4;

/// Refuses a frame rate (frames/s) out of [`FRAME_RATES`].
pub(crate) fn check_frame_rate(rate: f64) -> Result<(), String> {
    if FRAME_RATES.contains(&rate) {
        return Ok(());
    }
    Err(format!(
        "a frame rate (mocap_framerate) of {rate:?} frames per second, expected {} to {}; is it the duration of a frame, or \
         another unit?",
        FRAME_RATES.start(),
        FRAME_RATES.end()
    ))
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

impl Motion {
    /// Reads a motion npz, in any of the layouts of [`MotionFile`]. Of more than 22 joints those of the body are kept: those that
    /// `joint_names` says, or else the first.
    ///
    /// # Errors
    /// [`FileError`] naming file, key or frame.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let file = MotionFile::read(path)?;
        let frame_rate = file.frame_rate(None).map_err(FileError::content(path))?;
        if file.joints > BODY_JOINT_COUNT && stands_along_z(&file.poses) {
            tracing::warn!(
                "{}: the body lies on its back as in files with z up; `clothcombo import amass` turns those",
                path.display()
            );
        }
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let source = Provenance::read(&mut NpzFile::open(path)?);
        let motion = Self { name, frame_rate, poses: file.poses, source };
        motion.check().map_err(FileError::content(path))?;
        Ok(motion)
    }

    /// Checks frame rate and angles: what is read and what is written must pass.
    ///
    /// # Errors
    /// Naming the frame and joint that do not.
    pub fn check(&self) -> Result<(), String> {
        check_frame_rate(self.frame_rate)?;
        let name = |joint: usize| BODY_JOINT_NAMES.get(joint).copied().unwrap_or("of no body");
        for (frame, pose) in self.poses.iter().enumerate() {
            for (joint, rotation) in pose.rotations.iter().enumerate() {
                if rotation.iter().any(|x| !x.is_finite()) {
                    return Err(format!(
                        "frame {frame}, joint {joint} ({}) has a non-finite rotation",
                        name(joint)
                    ));
                }
                // By component, not by length: rounded to f32 in a file they pass still.
                let angle = rotation.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
                if angle > MAX_ANGLE {
                    return Err(format!(
                        "frame {frame}, joint {joint} ({}) turns by {angle:?} rad, more than the {MAX_ANGLE} rad of any motion; \
                         is the file damaged, or in another format?",
                        name(joint)
                    ));
                }
            }
        }
        Ok(())
    }

    /// Writes the motion npz.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let rows: Vec<f32> = self
            .poses
            .iter()
            .flat_map(|pose| (0..BODY_JOINT_COUNT).flat_map(|j| pose.rotation(j)))
            .map(|x| x as f32)
            .collect();
        let mut npz = NpzWriter::new();
        npz.f32("poses", &[self.poses.len(), 3 * BODY_JOINT_COUNT], &rows)
            .f64("mocap_framerate", &[], &[self.frame_rate])
            .strings("joint_names", &[BODY_JOINT_COUNT], &BODY_JOINT_NAMES);
        self.source.write(&mut npz);
        npz.save(path)
    }
}

/// Whether the body stands along z, as in files with z up.
pub(crate) fn stands_along_z(poses: &[Pose]) -> bool {
    mean_up(poses)[2] > 0.7
}

/// Mean direction of the body's own vertical axis in the world: of length 1 if it never turns over.
pub(crate) fn mean_up(poses: &[Pose]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pose in poses {
        let root = matrix_from_axis_angle(pose.rotation(0));
        (0..3).for_each(|axis| sum[axis] += root[axis][1]);
    }
    sum.map(|x| x / poses.len().max(1) as f64)
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
    fn joints_are_found_by_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("named.npz");
        // Joint j turns by j; the file has them backwards, with one more in front.
        let load = |names: &[&str]| {
            let row: Vec<f32> = (0..names.len()).rev().flat_map(|j| [j as f32, 0.0, 0.0]).collect();
            let mut npz = NpzWriter::new();
            npz.f32("poses", &[1, row.len()], &row).f64("mocap_framerate", &[], &[30.0]);
            npz.strings("joint_names", &[names.len()], names);
            npz.save(&path).unwrap();
            let first = |motion: Motion| motion.poses[0].rotations.iter().map(|r| r[0]).collect::<Vec<_>>();
            Motion::load(&path).map(first)
        };
        let backwards: Vec<&str> = ["jaw"].into_iter().chain(BODY_JOINT_NAMES.into_iter().rev()).collect();
        let ascending: Vec<f64> = (0..22).map(f64::from).collect();
        assert_eq!(load(&backwards).unwrap(), ascending);
        // Names of another kind say nothing; where some are known, all must be.
        let numbers: Vec<String> = (0..22).map(|j| format!("joint {j}")).collect();
        let descending: Vec<f64> = (0..22).rev().map(f64::from).collect();
        assert_eq!(load(&numbers.iter().map(String::as_str).collect::<Vec<_>>()).unwrap(), descending);
        let row: Vec<f32> = (0..22).flat_map(|j| [j as f32, 0.0, 0.0]).collect();
        let mut npz = NpzWriter::new();
        npz.f32("poses", &[1, 66], &row).f64("mocap_framerate", &[], &[30.0]).f32(
            "joint_names",
            &[1],
            &[0.0],
        );
        npz.save(&path).unwrap();
        assert_eq!(
            Motion::load(&path).unwrap().poses[0].rotations[21],
            [21.0, 0.0, 0.0],
            "names that are no text"
        );
        let mut misspelt = BODY_JOINT_NAMES;
        misspelt[5] = "right_knie";
        let message = load(&misspelt).unwrap_err().to_string();
        assert!(message.contains("named.npz") && message.contains("'right_knee'"), "{message}");
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
        assert!(message.contains("frame 1, joint 2 (right_hip)"), "{message}");
    }

    #[test]
    fn rates_and_angles_of_no_motion_are_refused_with_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("clip.npz");
        let load = |rate: f64, angle: f32| {
            let mut rows = vec![0.0f32; 132];
            rows[66 + 3 * 4 + 1] = angle;
            let mut npz = NpzWriter::new();
            npz.f32("poses", &[2, 66], &rows).f64("mocap_framerate", &[], &[rate]);
            npz.save(&path).unwrap();
            Motion::load(&path).map_err(|e| e.to_string())
        };
        for rate in [0.01, 29.97, 10_000.0] {
            assert_eq!(load(rate, -1e4).unwrap().frame_rate, rate);
        }
        for rate in [0.0, -30.0, 1e-305, 0.0099, 10_001.0, 1e300, f64::INFINITY, f64::NAN] {
            let message = load(rate, 0.0).unwrap_err();
            assert!(message.contains("clip.npz") && message.contains("expected 0.01 to 10000"), "{message}");
        }
        for angle in [1.1e4, -1e30, f32::MAX] {
            let message = load(30.0, angle).unwrap_err();
            assert!(message.contains("clip.npz: frame 1, joint 4 (left_knee) turns by"), "{message}");
        }
    }
}
