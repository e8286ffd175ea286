//! `--joints MAP.toml`: which joint of a rig is which of the 22 body joints, for rigs whose names are not known.
//!
//! ```toml
//! pelvis = "Hips"
//! left_hip = "LThigh"
//! ```

use super::joint_map;
use super::recording::Recording;
use crate::asset::skeleton::{BODY_JOINT_COUNT, BODY_JOINT_NAMES, joint_index};
use crate::format::FileError;
use crate::import::retarget::JointMap;
use std::fs;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// A file of joint names.
#[derive(Clone, Debug, PartialEq)]
pub struct JointFile {
    path: PathBuf,
    /// Body joint, joint of the rig, line.
    entries: Vec<(usize, String, usize)>,
}

impl JointFile {
    /// Reads a file; body joints that are left out, or `""`, follow their parents.
    ///
    /// # Errors
    /// [`FileError`] naming file, line and key.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = fs::read_to_string(path).map_err(FileError::io(path))?;
        let table = DeTable::parse(&text).map_err(|e| FileError::content(path)(e.to_string().trim_end()))?;
        let mut keys: Vec<_> = table.get_ref().iter().collect();
        keys.sort_by_key(|(key, _)| key.span().start);
        let mut entries: Vec<(usize, String, usize)> = Vec::new();
        for (key, value) in keys {
            let line = 1 + text[..key.span().start].matches('\n').count();
            let key: &str = key.get_ref();
            let wrong = FileError::line(path, line);
            let joint = joint_index(key).ok_or_else(|| {
                wrong(format!(
                    "'{key}' is no joint of the body; nearest are {}; the joints are {}",
                    nearest(key, &BODY_JOINT_NAMES).join(", "),
                    BODY_JOINT_NAMES.join(", ")
                ))
            })?;
            let name = value.get_ref().as_str().ok_or_else(|| {
                let value = &text[value.span()];
                wrong(format!(
                    "'{key}' is {value}, expected the name of a joint, for example {key} = \"Hips\""
                ))
            })?;
            if let Some((other, ..)) = entries.iter().find(|(_, found, _)| !name.is_empty() && found == name)
            {
                let other = BODY_JOINT_NAMES[*other];
                return Err(wrong(format!(
                    "'{name}' is named for {other} and for {key}; a joint is one of them"
                )));
            }
            if !name.is_empty() {
                entries.push((joint, name.to_owned(), line));
            }
        }
        Ok(Self { path: path.into(), entries })
    }

    /// The joints of `recording` by these names.
    ///
    /// # Errors
    /// [`FileError`] naming file, line and name of a joint that the rig has not, or what is missing.
    pub fn resolve(&self, recording: &Recording) -> Result<JointMap, FileError> {
        let mut map: JointMap = [None; BODY_JOINT_COUNT];
        for (joint, name, line) in &self.entries {
            map[*joint] = Some(recording.joint(name).ok_or_else(|| {
                let names: Vec<&str> = recording.joints.iter().map(|j| j.name.as_str()).collect();
                FileError::line(&self.path, *line)(format!(
                    "the rig has no joint '{name}' (for {}); nearest are {}",
                    BODY_JOINT_NAMES[*joint],
                    nearest(name, &names).join(", ")
                ))
            })?);
        }
        match joint_map::missing(&map)[..] {
            [] => Ok(map),
            ref missing => Err(FileError::content(&self.path)(format!("it names no {}", missing.join(", ")))),
        }
    }
}

/// What a file for `recording` looks like, with the joints that are known.
pub fn template(recording: &Recording, map: &JointMap) -> String {
    let line = |(joint, found): (&&str, &Option<usize>)| match found {
        Some(found) => format!("{joint} = {:?}\n", recording.joints[*found].name),
        None => format!("{joint} = \"\"\n"),
    };
    BODY_JOINT_NAMES.iter().zip(map).map(line).collect()
}

/// The three of `names` that are spelt most like `name`.
fn nearest<'a>(name: &str, names: &[&'a str]) -> Vec<&'a str> {
    let mut sorted = names.to_vec();
    sorted.sort_by_cached_key(|other| edit_distance(&name.to_lowercase(), &other.to_lowercase()));
    sorted.truncate(3);
    sorted
}

/// Letters to change, add or drop.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut before = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let changed = before + usize::from(x != *y);
            before = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(before + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::bvh::{self, SMALL};

    fn load(text: &str) -> Result<JointFile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.toml");
        fs::write(&path, text).unwrap();
        JointFile::load(&path).map_err(|e| e.to_string())
    }

    #[test]
    fn mistakes_name_file_line_and_the_nearest_names() {
        for (text, parts) in [
            (
                "pelvis = \"Hips\"\nleft_hipp = \"A\"\n",
                &["map.toml:2: 'left_hipp'", "nearest are left_hip"][..],
            ),
            ("left_hip = \"A\"\nleft_hip_ = \"B\"\n", &["map.toml:2: 'left_hip_'"]),
            ("pelvis = 3\n", &["map.toml:1: 'pelvis' is 3"]),
            ("left_hip = \"A\"\nright_hip = \"A\"\n", &["map.toml:2:", "'A' is named for left_hip"]),
            ("pelvis = ", &["map.toml: ", "line 1"]),
        ] {
            let message = load(text).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
        let recording = bvh::parse(SMALL, Path::new("walk.bvh")).unwrap();
        let message = load("\npelvis = \"Hipps\"\n").unwrap().resolve(&recording).unwrap_err().to_string();
        assert!(message.contains("map.toml:2: the rig has no joint 'Hipps'"), "{message}");
        assert!(message.contains("nearest are Hips, Chest"), "{message}");
        let message =
            load("pelvis = \"Hips\"\nhead = \"\"\n").unwrap().resolve(&recording).unwrap_err().to_string();
        assert!(message.contains("it names no left_hip, right_hip"), "{message}");
    }

    #[test]
    fn spelling_decides_what_is_near() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(nearest("RKnee", &["Hips", "rknee", "LKnee", "Head"])[..2], ["rknee", "LKnee"]);
    }
}
