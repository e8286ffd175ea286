//! Acclaim skeletons (`.asf`): bones that begin where their parents end.
//!
//! A bone turns about its beginning, which is the joint of its name. Its angles turn about axes of its own, which `axis` gives
//! at rest by angles about the world's; `dof` lists which of them a motion gives. Rotations are applied in the order that `axis`
//! names: in `XYZ`, x first. Lengths, masses and limits are not needed: limits are of the software that solved the markers, and
//! of the lengths only the direction between joints is used.

use super::words::{lines, numbers};
use crate::asset::rotation::{IDENTITY, Matrix3, matrix_from_axis_angle, product};
use crate::format::FileError;
use crate::import::rig::{Channel, RigJoint, check_angle};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// A bone; the first of a skeleton is its root.
#[derive(Clone, Debug, Default)]
pub(super) struct AcclaimBone {
    pub name: String,
    /// Where it begins in its file.
    line: usize,
    direction: [f64; 3],
    /// From its beginning to its end (file units).
    length: f64,
    axes: Option<Matrix3>,
    /// Axes in the order in which they are turned about.
    order: [usize; 3],
    /// What a motion gives, in its order: which axis, and whether it turns.
    pub dof: Vec<Channel>,
    /// Added to the angles of every frame, by axis (degrees): the root's orientation.
    pub offset: [f64; 3],
    parent: Option<usize>,
}

/// A skeleton.
#[derive(Clone, Debug)]
pub(super) struct AcclaimSkeleton {
    /// Parents first.
    pub bones: Vec<AcclaimBone>,
    /// Whether angles are in radians where a motion does not say.
    pub radians: bool,
    /// Its file, for messages.
    pub path: PathBuf,
}

const ROOT_NAME: &str = "root";
const XYZ: [usize; 3] = [0, 1, 2];

impl AcclaimSkeleton {
    /// Parses ASF text; `path` is for messages only.
    pub fn parse(text: &str, path: &Path) -> Result<Self, FileError> {
        let mut reader = SkeletonReader {
            root: AcclaimBone { name: ROOT_NAME.into(), line: 1, order: XYZ, ..AcclaimBone::default() },
            bones: Vec::new(),
            index: HashMap::new(),
            open: None,
            parents: HashMap::new(),
            radians: false,
        };
        let mut section = String::new();
        let mut last = 1;
        for (line, words) in lines(text) {
            last = line;
            match words[0].strip_prefix(':') {
                Some(name) => section = name.to_ascii_lowercase(),
                None => reader.line(&section, line, &words).map_err(FileError::line(path, line))?,
            }
        }
        let radians = reader.radians;
        let bones = reader.finish(last).map_err(|(line, message)| FileError::line(path, line)(message))?;
        Ok(Self { bones, radians, path: path.into() })
    }

    /// The joints of the bones.
    pub fn joints(&self) -> Vec<RigJoint> {
        let joint = |bone: &AcclaimBone| RigJoint {
            name: bone.name.clone(),
            parent: bone.parent,
            // A bone begins where its parent ends; where the root stands is all the same.
            offset: bone.parent.map_or([0.0; 3], |parent| {
                let parent = &self.bones[parent];
                parent.direction.map(|x| x * parent.length)
            }),
            axes: bone.axes,
            channels: bone.channels().into_iter().map(|place| bone.dof[place]).collect(),
        };
        self.bones.iter().map(joint).collect()
    }
}

impl AcclaimBone {
    /// The places in `dof` of its channels, the outermost rotation, which is applied last, first.
    pub fn channels(&self) -> Vec<usize> {
        let place = |axis: &usize, rotates: bool| {
            self.dof.iter().position(|c| *c == Channel { axis: *axis, rotates })
        };
        let turns = self.order.iter().rev().filter_map(|axis| place(axis, true));
        turns.chain(XYZ.iter().filter_map(|axis| place(axis, false))).collect()
    }
}

struct SkeletonReader<'a> {
    root: AcclaimBone,
    /// All bones but the root, in the order of the file.
    bones: Vec<AcclaimBone>,
    index: HashMap<String, usize>,
    /// The bone between `begin` and `end`, and which of its keys were read.
    open: Option<(AcclaimBone, Vec<String>)>,
    /// Child, parent and line.
    parents: HashMap<&'a str, (&'a str, usize)>,
    radians: bool,
}

impl<'a> SkeletonReader<'a> {
    fn line(&mut self, section: &str, line: usize, words: &[&'a str]) -> Result<(), String> {
        match section {
            "units" => self.unit(words),
            "root" => self.root_line(words),
            "bonedata" => self.bone_line(line, words),
            "hierarchy" => self.family(line, words),
            "" => Err(format!("'{}' before the first section; an ASF file begins with :version", words[0])),
            _ => Ok(()),
        }
    }

    fn unit(&mut self, words: &[&str]) -> Result<(), String> {
        if words[0].eq_ignore_ascii_case("angle") {
            self.radians = match words.get(1).map(|w| w.to_ascii_lowercase()).as_deref() {
                Some("deg") => false,
                Some("rad") => true,
                other => return Err(format!("'{}' is no unit of angles: deg or rad", other.unwrap_or(""))),
            };
        }
        Ok(())
    }

    fn degrees(&self, angle: f64) -> f64 {
        if self.radians { angle.to_degrees() } else { angle }
    }

    fn root_line(&mut self, words: &[&str]) -> Result<(), String> {
        match words[0].to_ascii_lowercase().as_str() {
            "order" => self.root.dof = channels(&words[1..])?,
            "axis" => self.root.order = order(words.get(1).copied())?,
            "orientation" => {
                self.root.offset = three(&words[1..], "orientation")?.map(|angle| self.degrees(angle));
                self.root.offset.iter().try_for_each(|angle| check_angle(ROOT_NAME, *angle))?;
            }
            // Where the body stands is all the same.
            _ => {}
        }
        Ok(())
    }

    fn bone_line(&mut self, line: usize, words: &[&str]) -> Result<(), String> {
        let key = words[0].to_ascii_lowercase();
        match (key.as_str(), self.open.take()) {
            ("begin", None) => {
                self.open = Some((AcclaimBone { line, order: XYZ, ..AcclaimBone::default() }, Vec::new()));
                return Ok(());
            }
            ("begin", Some((bone, _))) => {
                return Err(format!("the bone that begins at line {} has no 'end'", bone.line));
            }
            ("end", Some((bone, keys))) => {
                if let Some(missing) =
                    ["name", "direction", "length", "axis"].iter().find(|key| !keys.iter().any(|k| k == *key))
                {
                    return Err(format!("the bone that begins at line {} has no '{missing}'", bone.line));
                }
                if bone.name == ROOT_NAME || self.index.insert(bone.name.clone(), self.bones.len()).is_some()
                {
                    return Err(format!("there are two bones '{}'", bone.name));
                }
                self.bones.push(bone);
                return Ok(());
            }
            (_, Some(open)) => self.open = Some(open),
            (_, None) => return Err(format!("expected 'begin', found '{}'", words[0])),
        }
        let radians = self.radians;
        let Some((bone, keys)) = &mut self.open else { return Ok(()) };
        let rest = &words[1..];
        match key.as_str() {
            "name" => bone.name = rest.join(" "),
            "direction" => bone.direction = three(rest, "direction")?,
            "length" => {
                let [length] = numbers(rest, "length")?[..] else {
                    return Err("'length' takes one number".into());
                };
                bone.length = length;
            }
            "axis" => {
                bone.order = order(rest.get(3).copied())?;
                let angles = three(&rest[..rest.len().min(3)], "axis")?;
                bone.axes = Some(bone.order.iter().fold(IDENTITY, |turned, &axis| {
                    let mut turn = [0.0; 3];
                    turn[axis] = if radians { angles[axis] } else { angles[axis].to_radians() };
                    product(&matrix_from_axis_angle(turn), &turned)
                }));
            }
            "dof" => bone.dof = channels(rest)?,
            // Among them limits, which go over several lines.
            _ => return Ok(()),
        }
        keys.push(key);
        Ok(())
    }

    fn family(&mut self, line: usize, words: &[&'a str]) -> Result<(), String> {
        if let ["begin"] | ["end"] = words {
            return Ok(());
        }
        for child in &words[1..] {
            if let Some((parent, before)) = self.parents.insert(child, (words[0], line)) {
                return Err(format!("'{child}' hangs on '{parent}' already (line {before})"));
            }
        }
        Ok(())
    }

    /// The bones, parents first, or the line that is wrong and why; `last` is the last line.
    fn finish(self, last: usize) -> Result<Vec<AcclaimBone>, (usize, String)> {
        if let Some((bone, _)) = self.open {
            return Err((last, format!("the file ends within the bone that begins at line {}", bone.line)));
        }
        if self.root.dof.is_empty() {
            return Err((last, "no ':root' with 'order', for example TX TY TZ RX RY RZ".into()));
        }
        let mut children: HashMap<&str, Vec<usize>> = HashMap::new();
        let mut links: Vec<_> = self.parents.into_iter().collect();
        links.sort_unstable_by_key(|(child, (_, line))| (*line, *child));
        for (child, (parent, line)) in links {
            let unknown = |name: &str| (line, format!("no bone is called '{name}' in ':bonedata'"));
            if parent != ROOT_NAME && !self.index.contains_key(parent) {
                return Err(unknown(parent));
            }
            let child = *self.index.get(child).ok_or_else(|| unknown(child))?;
            children.entry(parent).or_default().push(child);
        }
        let mut left: Vec<Option<AcclaimBone>> = self.bones.into_iter().map(Some).collect();
        let mut taken = vec![self.root];
        let mut place = 0;
        while let Some(bone) = taken.get(place) {
            let own = children.remove(bone.name.as_str()).unwrap_or_default();
            let own = own.into_iter().filter_map(|child| left[child].take());
            taken.extend(own.map(|bone| AcclaimBone { parent: Some(place), ..bone }).collect::<Vec<_>>());
            place += 1;
        }
        match left.into_iter().flatten().next() {
            None => Ok(taken),
            Some(bone) => {
                Err((bone.line, format!("bone '{}' does not hang on the root in ':hierarchy'", bone.name)))
            }
        }
    }
}

/// `TX TY TZ RX RY RZ` and the like.
fn channels(words: &[&str]) -> Result<Vec<Channel>, String> {
    let mut channels: Vec<Channel> = Vec::new();
    for word in words {
        let channel = match word.to_ascii_lowercase().as_bytes() {
            [kind @ (b't' | b'r'), axis @ b'x'..=b'z'] => {
                Channel { axis: usize::from(axis - b'x'), rotates: *kind == b'r' }
            }
            _ => return Err(format!("'{word}' is no degree of freedom, for example rx")),
        };
        if channels.contains(&channel) {
            return Err(format!("'{word}' is there twice"));
        }
        channels.push(channel);
    }
    Ok(channels)
}

/// `XYZ` and the like.
fn order(word: Option<&str>) -> Result<[usize; 3], String> {
    let wrong = || format!("'{}' is no order of axes, for example XYZ", word.unwrap_or(""));
    let letters = word.ok_or_else(wrong)?.to_ascii_uppercase();
    let axes: Vec<usize> = letters.bytes().filter_map(|c| b"XYZ".iter().position(|x| *x == c)).collect();
    let axes: [usize; 3] = axes.try_into().map_err(|_| wrong())?;
    let all = XYZ.iter().all(|axis| axes.contains(axis)) && letters.len() == 3;
    all.then_some(axes).ok_or_else(wrong)
}

fn three(words: &[&str], what: &str) -> Result<[f64; 3], String> {
    let found = numbers(words, what)?;
    found.try_into().map_err(|found: Vec<f64>| format!("'{what}' takes 3 numbers, found {}", found.len()))
}
