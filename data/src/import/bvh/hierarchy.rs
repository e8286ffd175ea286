//! Biovision hierarchy (BVH) motion capture: a joint tree with rest offsets, and channel values per frame.

use crate::asset::motion::check_frame_rate;
use crate::format::{FileError, way_out};
use crate::import::rig::{Channel, Recording, RigJoint, check_angle};
use std::fs;
use std::path::Path;

/// No motion has longer frames (s): more is a rate.
const LONGEST_FRAME: f64 = 2.0;

/// Deeper trees than any skeleton are damage.
const DEEPEST_TREE: usize = 256;

struct Words<'a> {
    words: Vec<(usize, &'a str)>,
    at: usize,
    path: &'a Path,
}

impl<'a> Words<'a> {
    fn error(&self, message: String) -> FileError {
        let line =
            self.words.get(self.at.saturating_sub(1)).or(self.words.last()).map_or(1, |(line, _)| *line);
        FileError::line(self.path, line)(message)
    }

    fn next(&mut self, expected: &str) -> Result<&'a str, FileError> {
        let word = self.words.get(self.at).map(|(_, word)| *word);
        self.at += 1;
        word.ok_or_else(|| self.error(format!("the file ends where {expected} should be")))
    }

    /// A joint's name: the rest of the line up to a brace, as some rigs have spaces in it.
    fn name(&mut self) -> Result<String, FileError> {
        let first = self.next("a joint name")?;
        let line = self.words.get(self.at - 1).map(|(line, _)| *line);
        let mut name = first.to_string();
        while let Some((_, word)) =
            self.words.get(self.at).filter(|(at, word)| Some(*at) == line && *word != "{")
        {
            name.push(' ');
            name.push_str(word);
            self.at += 1;
        }
        Ok(name)
    }

    fn peek(&self) -> Option<&'a str> {
        self.words.get(self.at).map(|(_, word)| *word)
    }

    fn expect(&mut self, expected: &str) -> Result<(), FileError> {
        let word = self.next(&format!("'{expected}'"))?;
        if word.eq_ignore_ascii_case(expected) {
            return Ok(());
        }
        Err(self.error(format!("expected '{expected}', found '{word}'")))
    }

    fn number(&mut self, what: &str) -> Result<f64, FileError> {
        let word = self.next(what)?;
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Err(self.error(format!("'{word}' is not a finite number ({what})"))),
        }
    }

    fn offset(&mut self) -> Result<[f64; 3], FileError> {
        self.expect("OFFSET")?;
        Ok([self.number("an offset")?, self.number("an offset")?, self.number("an offset")?])
    }
}

/// What some editors begin a text with.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// Reads a BVH file.
///
/// # Errors
/// [`FileError`] naming file and line.
pub fn load(path: &Path) -> Result<Recording, FileError> {
    let bytes = fs::read(path).map_err(FileError::io(path))?;
    if let (false, Some(way_out)) = (bytes.starts_with(b"HIERARCHY"), way_out(path)) {
        return Err(FileError::content(path)(way_out));
    }
    parse(&String::from_utf8_lossy(&bytes), path)
}

/// Parses BVH text; `path` is for messages only.
///
/// # Errors
/// [`FileError`] naming file and line.
pub fn parse(text: &str, path: &Path) -> Result<Recording, FileError> {
    let lines = text.trim_start_matches(BYTE_ORDER_MARK).lines().enumerate();
    let words =
        lines.flat_map(|(n, line)| line.split_ascii_whitespace().map(move |word| (n + 1, word))).collect();
    let mut words = Words { words, at: 0, path };
    words.expect("HIERARCHY")?;
    words.expect("ROOT")?;
    let mut joints = Vec::new();
    read_joint(&mut words, &mut joints, None, 0)?;
    words.expect("MOTION")?;
    words.expect("Frames:")?;
    let announced = words.number("the number of frames")?;
    words.expect("Frame")?;
    words.expect("Time:")?;
    let frame_time = words.number("the frame time")?;
    if frame_time <= 0.0 {
        return Err(words.error(format!("frame time {frame_time} is not positive")));
    }
    check_frame_rate(1.0 / frame_time)
        .map_err(|defect| words.error(format!("a frame time of {frame_time:?} s means {defect}")))?;
    if frame_time > LONGEST_FRAME {
        return Err(words.error(format!(
            "a frame time of {frame_time:?}: it is in seconds, {:?} for {frame_time:?} frames per second",
            1.0 / frame_time
        )));
    }
    let channel_count: usize = joints.iter().map(|j: &RigJoint| j.channels.len()).sum();
    let values = read_values(&mut words, &joints)?;
    if channel_count == 0 || values.len() < channel_count {
        return Err(
            words.error(format!("no whole frame: {} values for {channel_count} channels", values.len()))
        );
    }
    let (frames, rest) = (values.len() / channel_count, values.len() % channel_count);
    if rest > 0 {
        return Err(words.error(format!(
            "frame {frames} has {rest} of {channel_count} values; the header announces {announced} frames: is the file truncated?"
        )));
    }
    // Real files are off by one: the frames that are there count.
    if (frames as f64) < announced - 1.0 {
        return Err(words.error(format!(
            "the file ends after frame {}; the header announces {announced} frames: is the file truncated?",
            frames - 1
        )));
    }
    if joints.len() > 1 && joints[1..].iter().all(|joint| joint.offset == [0.0; 3]) {
        return Err(words.error("every OFFSET is 0: the skeleton has no bones".into()));
    }
    Ok(Recording::new(joints, 1.0 / frame_time, values))
}

/// The channel values of all frames.
fn read_values(words: &mut Words, joints: &[RigJoint]) -> Result<Vec<f64>, FileError> {
    let channels: Vec<(&str, bool)> =
        joints.iter().flat_map(|j| j.channels.iter().map(|c| (j.name.as_str(), c.rotates))).collect();
    let mut values = Vec::with_capacity(words.words.len().saturating_sub(words.at));
    while words.peek().is_some() {
        let value = words.number("a channel value")?;
        if let Some((name, true)) = channels.get(values.len() % channels.len().max(1)) {
            check_angle(name, value).map_err(|defect| words.error(defect))?;
        }
        values.push(value);
    }
    Ok(values)
}

fn read_joint(
    words: &mut Words,
    joints: &mut Vec<RigJoint>,
    parent: Option<usize>,
    depth: usize,
) -> Result<(), FileError> {
    if depth > DEEPEST_TREE {
        return Err(words.error(format!("the joint tree is deeper than {DEEPEST_TREE}")));
    }
    let name = words.name()?;
    words.expect("{")?;
    let offset = words.offset()?;
    let mut channels = Vec::new();
    if words.peek().is_some_and(|w| w.eq_ignore_ascii_case("CHANNELS")) {
        words.at += 1;
        let count = words.number("the number of channels")?;
        if !(0.0..=6.0).contains(&count) {
            return Err(words.error(format!("{count} channels; a joint has at most 6")));
        }
        for _ in 0..count as usize {
            let word = words.next("a channel")?;
            let axis =
                word.bytes().next().and_then(|c| b"XYZ".iter().position(|x| *x == c.to_ascii_uppercase()));
            let lower = word.to_ascii_lowercase();
            let rotates = lower.ends_with("rotation");
            let Some(axis) = axis.filter(|_| rotates || lower.ends_with("position")) else {
                return Err(words.error(format!("'{word}' is not a channel, for example Xrotation")));
            };
            channels.push(Channel { axis, rotates });
        }
    }
    let index = joints.len();
    joints.push(RigJoint { name, parent, offset, axes: None, channels });
    loop {
        match words.next("'}'")? {
            "}" => return Ok(()),
            w if w.eq_ignore_ascii_case("JOINT") => read_joint(words, joints, Some(index), depth + 1)?,
            w if w.eq_ignore_ascii_case("End") => {
                words.expect("Site")?;
                words.expect("{")?;
                words.offset()?;
                words.expect("}")?;
            }
            other => return Err(words.error(format!("expected JOINT, End Site or '}}', found '{other}'"))),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::asset::rotation;

    pub(crate) const SMALL: &str = "HIERARCHY\nROOT Hips\n{\n OFFSET 0 1 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n JOINT Chest\n {\n  OFFSET 0 2 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 1 0\n  }\n }\n}\nMOTION\nFrames: 1\nFrame Time: 0.0083333\n0 0 0 90 0 0 0 90 0\n5 5 5 0 90 0 0 0 0\n";

    fn parse(text: &str) -> Result<Recording, String> {
        super::parse(text, Path::new("walk.bvh")).map_err(|e| e.to_string())
    }

    #[test]
    fn reads_tree_and_all_frames_there_are() {
        let bvh = parse(SMALL).unwrap();
        assert_eq!(bvh.frame_count(), 2);
        assert_eq!(bvh.joints[1].parent, Some(0));
        assert_eq!(bvh.rest_positions(), [[0.0, 1.0, 0.0], [0.0, 3.0, 0.0]]);
        // Only angles have a limit.
        assert!(parse(&SMALL.replace("5 5 5", "5 1e6 5")).is_ok());
    }

    #[test]
    fn rotations_follow_the_channel_order_down_the_tree() {
        let bvh = parse(SMALL).unwrap();
        let world = bvh.world_rotations(0);
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-12);
        assert!(close(rotation::apply(&world[0], [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]));
        // Chest turns 90° about its own x inside the turned hips: y → z, then the hips leave z.
        assert!(close(rotation::apply(&world[1], [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]));
        assert!(close(rotation::apply(&bvh.world_rotations(1)[0], [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]));
    }

    #[test]
    fn defects_name_their_line() {
        for (text, line, part) in [
            (SMALL.replace("0 2 0", "0 x 0"), 8, "'x' is not a finite number"),
            (SMALL.replace("Yrotation Xrotation\n", "Yrotation Wrotation\n"), 5, "not a channel"),
            (SMALL.replace("Frame Time: 0.0083333", "Frame Time: 0"), 18, "not positive"),
            (SMALL.replace("Frame Time: 0.0083333", "Frame Time: 1e-320"), 18, "expected 0.01 to 10000"),
            (SMALL.replace("Frame Time: 0.0083333", "Frame Time: 1e300"), 18, "expected 0.01 to 10000"),
            (SMALL.replace("Frame Time: 0.0083333", "Frame Time: 30"), 18, "for 30.0 frames per second"),
            (SMALL.replace("0 90 0 0 0 0\n", "0 90\n"), 20, "frame 1 has 5 of 9 values"),
            (SMALL.replace("Frames: 1", "Frames: 40"), 20, "the header announces 40 frames"),
            (SMALL.replace("OFFSET 0 2 0", "OFFSET 0 0 0"), 20, "every OFFSET is 0"),
            (SMALL.replace("90 0 0 0 90 0", "90 0 0 0 nan 0"), 19, "'nan'"),
            (SMALL.replace("90 0 0 0 90 0", "90 0 0 0 9e20 0"), 19, "joint 'Chest' turns by"),
            (SMALL.split("MOTION").next().unwrap().into(), 15, "the file ends"),
            (SMALL.replace("CHANNELS 6", "CHANNELS 999999999"), 5, "at most 6"),
        ] {
            let message = parse(&text).unwrap_err();
            assert!(message.starts_with(&format!("walk.bvh:{line}:")) && message.contains(part), "{message}");
        }
    }
}
