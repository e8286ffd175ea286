//! A face of a file after repairs.

/// A polygon that came of a face of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileFace {
    /// The face of the file, from 0.
    pub face: u32,
    /// For each corner the vertex it has now, and which corner of the file's face it was; of a corner that splits an edge the
    /// nearer end.
    pub corners: Vec<[u32; 2]>,
}
