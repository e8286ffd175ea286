//! Consecutive blocks of rows that share one row of something.

use std::ops::Range;
use std::sync::Arc;

/// Row just past each segment, ascending.
pub(crate) type SegmentEnds = Arc<[usize]>;

/// Splits N packed rows into M consecutive segments (the vertices of M garments).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segments {
    ends: SegmentEnds,
}

impl Segments {
    /// Segments of the given lengths, in order.
    pub fn new(lengths: impl IntoIterator<Item = usize>) -> Self {
        let running_sum = |end: &mut usize, length| {
            *end += length;
            Some(*end)
        };
        Self { ends: lengths.into_iter().scan(0, running_sum).collect() }
    }

    /// Number of segments M.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    /// Number of rows N of all segments together.
    pub fn rows(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// Row just past each segment.
    pub(super) fn ends(&self) -> &SegmentEnds {
        &self.ends
    }

    /// The rows of each segment.
    pub fn ranges(&self) -> Vec<Range<usize>> {
        ranges(&self.ends).collect()
    }
}

/// The rows of each segment.
pub(super) fn ranges(ends: &[usize]) -> impl Iterator<Item = Range<usize>> + '_ {
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts.zip(ends).map(|(start, &end)| start..end)
}
