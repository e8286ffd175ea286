//! Point caches with half-precision coordinates (`.pc16` of CLOTH3D): the positions of a mesh's vertices in every frame.
//!
//! Layout, little-endian: `POINTCACHE2\0`, i32 version = 1, i32 points, f32 first frame, f32 rate, i32 frames, then
//! f16 `[frames × points × 3]`.

use super::error::FileError;
use half::f16;
use std::fs;
use std::io::Read;
use std::path::Path;

/// Vertex positions over time, in the unit and axes of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCache {
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
    /// [`FileError`].
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let failed = FileError::io(path);
        let content = FileError::content(path);
        let wrong =
            |reason: String| content(format!("{reason}; a .pc16 file starts with POINTCACHE2, version 1"));
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
            let message = format!("{size} bytes, but {frames} frames of {points} points are {expected}");
            return Err(content(message));
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
            return Err(content(format!("frame {frame}, point {point} is not finite")));
        }
        Ok(Self { point_count, positions })
    }

    /// Number of frames.
    pub fn frame_count(&self) -> usize {
        self.positions.len() / self.point_count
    }
}
