//! Point caches: the positions of a mesh's vertices in every frame, for the mesh cache modifiers of modelling programs.
//!
//! Two layouts that many programs read. PC2, little-endian: `POINTCACHE2\0`, i32 version = 1, i32 points, f32 first frame, f32
//! frames per sample, i32 samples. MDD, big-endian: i32 frames, i32 points, f32 time of every frame (s). Then, in both, f32
//! `[frames × points × 3]`.

use super::atomic;
use super::error::FileError;
use std::path::Path;

/// Vertex positions over time.
#[derive(Clone, Debug, Default)]
pub struct PointFrames {
    points: usize,
    seconds: Vec<f32>,
    positions: Vec<[f32; 3]>,
}

impl PointFrames {
    /// Adds the positions `[V, 3]` (m) of the frame at `seconds`.
    ///
    /// # Panics
    /// When another frame has another number of vertices.
    pub fn push(&mut self, seconds: f64, positions: &[[f64; 3]]) {
        assert!(self.seconds.is_empty() || self.points == positions.len(), "a mesh keeps its vertices");
        self.points = positions.len();
        self.seconds.push(seconds as f32);
        self.positions.extend(positions.iter().map(|p| p.map(|x| x as f32)));
    }

    /// Writes `.pc2`: one sample a frame, from frame 0 on.
    ///
    /// # Errors
    /// When the file cannot be written, or holds more than the format can count.
    pub fn save_pc2(&self, path: &Path) -> Result<(), FileError> {
        let [points, frames] = self.counts(path)?;
        let mut bytes = b"POINTCACHE2\0".to_vec();
        for word in [
            1i32.to_le_bytes(),
            points.to_le_bytes(),
            0f32.to_le_bytes(),
            1f32.to_le_bytes(),
            frames.to_le_bytes(),
        ] {
            bytes.extend(word);
        }
        bytes.extend(self.positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        atomic::write(path, &bytes).map_err(FileError::io(path))
    }

    /// Writes `.mdd`, with the times of the frames since the first.
    ///
    /// # Errors
    /// As [`save_pc2`](Self::save_pc2).
    pub fn save_mdd(&self, path: &Path) -> Result<(), FileError> {
        let [points, frames] = self.counts(path)?;
        let mut bytes: Vec<u8> = [frames, points].into_iter().flat_map(i32::to_be_bytes).collect();
        let first = self.seconds.first().copied().unwrap_or(0.0);
        let numbers =
            self.seconds.iter().map(|s| s - first).chain(self.positions.as_flattened().iter().copied());
        bytes.extend(numbers.flat_map(f32::to_be_bytes));
        atomic::write(path, &bytes).map_err(FileError::io(path))
    }

    fn counts(&self, path: &Path) -> Result<[i32; 2], FileError> {
        let count = |n: usize| {
            i32::try_from(n)
                .map_err(|_| FileError::content(path)(format!("{n} points or frames are too many for it")))
        };
        Ok([count(self.points)?, count(self.seconds.len())?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_layouts_are_those_that_others_read() {
        let folder = tempfile::tempdir().unwrap();
        let mut frames = PointFrames::default();
        frames.push(2.0, &[[1.0, -2.0, 0.5], [0.0, 0.0, 3.0]]);
        frames.push(2.5, &[[1.5, -2.0, 0.5], [0.0, 1.0, 3.0]]);
        let (pc2, mdd) = (folder.path().join("a.pc2"), folder.path().join("a.mdd"));
        frames.save_pc2(&pc2).unwrap();
        frames.save_mdd(&mdd).unwrap();
        let expected: [f32; 12] = [1.0, -2.0, 0.5, 0.0, 0.0, 3.0, 1.5, -2.0, 0.5, 0.0, 1.0, 3.0];
        let bytes = std::fs::read(pc2).unwrap();
        assert_eq!(bytes[..16], *b"POINTCACHE2\0\x01\0\0\0");
        assert_eq!(bytes[16..32], *b"\x02\0\0\0\0\0\0\0\0\0\x80\x3f\x02\0\0\0");
        let numbers: Vec<f32> =
            bytes[32..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        assert_eq!(numbers, expected);
        let bytes = std::fs::read(mdd).unwrap();
        assert_eq!(bytes[..8], *b"\0\0\0\x02\0\0\0\x02");
        let numbers: Vec<f32> =
            bytes[8..].as_chunks::<4>().0.iter().map(|b| f32::from_be_bytes(*b)).collect();
        assert_eq!(numbers[..2], [0.0, 0.5]);
        assert_eq!(numbers[2..], expected);
    }
}
