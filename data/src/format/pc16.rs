//! Point caches with half-precision coordinates (`.pc16` of CLOTH3D): the positions of a mesh's vertices in every frame.
//!
//! Layout, little-endian: `POINTCACHE2\0`, i32 version = 1, i32 points, f32 first frame, f32 rate, i32 frames, then
//! f16 `[frames × points × 3]`.

use super::error::FileError;
use half::f16;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a point cache cannot be used.
#[derive(Debug, Error)]
pub enum PointCacheError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] FileError),
    /// The header is not one of a point cache.
    #[error("{}: {reason}; a .pc16 file starts with POINTCACHE2, version 1", path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The data does not have the size the header says.
    #[error("{}: {found} bytes, but {frames} frames of {points} points are {expected}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Points per frame.
        points: u64,
        /// Frames.
        frames: u64,
        /// Size of the file [bytes].
        found: u64,
        /// Size it should have [bytes].
        expected: u64,
    },
    /// A coordinate is NaN or infinite.
    #[error("{}: frame {frame}, point {point} is not finite", path.display())]
    NonFinite {
        /// The file.
        path: PathBuf,
        /// The frame, from 0.
        frame: usize,
        /// The point, from 0.
        point: usize,
    },
}

/// Vertex positions over time, in the unit and axes of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCache {
    /// Number of the first frame.
    pub start: f32,
    /// Sampling rate as the file states it (often a step of 1 frame, not a frequency).
    pub rate: f32,
    /// Points per frame.
    pub point_count: usize,
    /// Positions of all points, frame after frame.
    pub positions: Vec<[f32; 3]>,
}

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const HEADER: usize = 32;

impl PointCache {
    /// Reads a file.
    ///
    /// # Errors
    /// [`PointCacheError`] naming the file and what is wrong with it.
    pub fn load(path: &Path) -> Result<Self, PointCacheError> {
        let failed = FileError::at(path);
        let wrong = |reason: String| PointCacheError::Header { path: path.into(), reason };
        let mut file = fs::File::open(path).map_err(&failed)?;
        let size = file.metadata().map_err(&failed)?.len();
        let mut header = [0u8; HEADER];
        if size < HEADER as u64 {
            return Err(wrong(format!("{size} bytes are less than a header")));
        }
        file.read_exact(&mut header).map_err(&failed)?;
        if !header.starts_with(MAGIC) {
            return Err(wrong("it is not a point cache".into()));
        }
        let word = |at: usize| [header[at], header[at + 1], header[at + 2], header[at + 3]];
        let version = i32::from_le_bytes(word(12));
        if version != 1 {
            return Err(wrong(format!("its version is {version}")));
        }
        let extent = |at: usize, what: &str| {
            let n = i32::from_le_bytes(word(at));
            u64::try_from(n).ok().filter(|n| *n > 0).ok_or_else(|| wrong(format!("it has {n} {what}")))
        };
        let (points, frames) = (extent(16, "points")?, extent(28, "frames")?);
        // Both are below 2³¹, so that six times their product fits in 64 bits but for the last of them.
        let expected = (points * frames).saturating_mul(6).saturating_add(HEADER as u64);
        if size != expected {
            return Err(PointCacheError::Size { path: path.into(), points, frames, found: size, expected });
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(&failed)?;
        let half =
            |cell: &[u8], axis: usize| f16::from_le_bytes([cell[2 * axis], cell[2 * axis + 1]]).to_f32();
        let positions: Vec<[f32; 3]> =
            bytes.chunks_exact(6).map(|cell| std::array::from_fn(|a| half(cell, a))).collect();
        let point_count = points as usize;
        if let Some(at) = positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            let (frame, point) = (at / point_count, at % point_count);
            return Err(PointCacheError::NonFinite { path: path.into(), frame, point });
        }
        let (start, rate) = (f32::from_le_bytes(word(20)), f32::from_le_bytes(word(24)));
        Ok(Self { start, rate, point_count, positions })
    }

    /// Number of frames.
    pub fn frame_count(&self) -> usize {
        self.positions.len() / self.point_count
    }

    /// The positions in one frame.
    ///
    /// # Panics
    /// If `frame` is not below [`Self::frame_count`].
    pub fn frame(&self, frame: usize) -> &[[f32; 3]] {
        &self.positions[frame * self.point_count..(frame + 1) * self.point_count]
    }
}
