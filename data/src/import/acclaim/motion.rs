//! Acclaim motions (`.amc`): in every frame, a line of values for each bone that moves.

use super::skeleton::AcclaimSkeleton;
use super::words::{lines, numbers};
use crate::format::FileError;
use crate::import::rig::check_angle;
use std::collections::HashMap;
use std::path::Path;

/// The values of the channels of all joints of `skeleton`, frame by frame (degrees); `path` is for messages only.
pub(super) fn parse(text: &str, path: &Path, skeleton: &AcclaimSkeleton) -> Result<Vec<f64>, FileError> {
    // Where the values of a bone are in a frame.
    let mut starts = Vec::new();
    let mut count = 0;
    for bone in &skeleton.bones {
        starts.push(count);
        count += bone.dof.len();
    }
    let index: HashMap<&str, usize> =
        skeleton.bones.iter().enumerate().map(|(i, bone)| (bone.name.as_str(), i)).collect();
    let orders: Vec<Vec<usize>> = skeleton.bones.iter().map(|bone| bone.channels()).collect();
    let mut radians = skeleton.radians;
    let mut values: Vec<f64> = Vec::new();
    let mut given = vec![true; skeleton.bones.len()];
    let (mut frame, mut frame_line) = (0.0, 0);
    for (line, words) in lines(text) {
        let failed = FileError::line(path, line);
        if let Some(flag) = words[0].strip_prefix(':') {
            match flag.to_ascii_lowercase().as_str() {
                "degrees" => radians = false,
                "radians" => radians = true,
                _ => {}
            }
            continue;
        }
        if let ([_], Ok(number)) = (&words[..], words[0].parse::<f64>()) {
            check_whole(skeleton, &given, frame).map_err(FileError::line(path, frame_line))?;
            (frame, frame_line) = (number, line);
            given = skeleton.bones.iter().map(|bone| bone.dof.is_empty()).collect();
            values.resize(values.len() + count, 0.0);
            continue;
        }
        let name = words[0];
        if values.is_empty() {
            return Err(failed(format!("'{name}' before the number of the first frame")));
        }
        let Some(&bone) = index.get(name) else {
            return Err(failed(format!(
                "no bone of {} is called '{name}'; is it the right skeleton?",
                skeleton.path.display()
            )));
        };
        let dof = &skeleton.bones[bone].dof;
        let found = numbers(&words[1..], name).map_err(&failed)?;
        if found.len() != dof.len() {
            let (found, wanted, skeleton) = (found.len(), dof.len(), skeleton.path.display());
            return Err(failed(format!(
                "'{name}' has {found} values for {wanted} degrees of freedom in {skeleton}"
            )));
        }
        if std::mem::replace(&mut given[bone], true) {
            return Err(failed(format!("'{name}' is there twice in frame {frame}")));
        }
        let start = values.len() - count + starts[bone];
        for (slot, &place) in values[start..].iter_mut().zip(&orders[bone]) {
            let channel = dof[place];
            *slot = found[place];
            if channel.rotates {
                let degrees = if radians { slot.to_degrees() } else { *slot };
                check_angle(name, degrees).map_err(&failed)?;
                *slot = degrees + skeleton.bones[bone].offset[channel.axis];
            }
        }
    }
    if values.is_empty() {
        return Err(FileError::content(path)("no frames: a frame begins with a line that is its number"));
    }
    check_whole(skeleton, &given, frame).map_err(FileError::line(path, frame_line))?;
    Ok(values)
}

fn check_whole(skeleton: &AcclaimSkeleton, given: &[bool], frame: f64) -> Result<(), String> {
    match given.iter().position(|given| !given) {
        None => Ok(()),
        Some(bone) => {
            let (name, skeleton) = (&skeleton.bones[bone].name, skeleton.path.display());
            Err(format!(
                "frame {frame} has no values of '{name}', which moves in {skeleton}; is the file truncated?"
            ))
        }
    }
}
