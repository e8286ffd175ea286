//! Seams in the report of a fit.

use crate::mesh::Seam;
use serde::Serialize;
use std::fmt;

/// Two borders of the file that run along each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SeamReport {
    /// Whether they were joined.
    pub joined: bool,
    /// Length (mm).
    pub length_mm: f64,
    /// Median distance between the borders (mm).
    pub gap_mm: f64,
    /// Largest distance between them (mm).
    pub widest_mm: f64,
    /// First and last vertex of one of the borders in the file, counted from 0.
    pub vertices: [u32; 2],
}

impl SeamReport {
    /// `metres` of the file's unit; the ends are vertices of the file.
    pub(in crate::fit) fn new(seam: &Seam, metres: f64, joined: bool) -> Self {
        let [length_mm, gap_mm, widest_mm] =
            [seam.length, seam.gap, seam.widest].map(|length| 1e3 * metres * length);
        Self { joined, length_mm, gap_mm, widest_mm, vertices: seam.ends }
    }
}

/// Seams in the report: how many of them are named one by one.
const SHOWN_SEAMS: usize = 8;

/// The joined or the open ones of `seams` in words; nothing if there are none.
pub(super) fn write_seams(f: &mut fmt::Formatter<'_>, seams: &[SeamReport], joined: bool) -> fmt::Result {
    let found: Vec<&SeamReport> = seams.iter().filter(|seam| seam.joined == joined).collect();
    if found.is_empty() {
        return Ok(());
    }
    let count = if found.len() == 1 { "1 seam".to_owned() } else { format!("{} seams", found.len()) };
    let (head, verb) = if joined { ("repaired  joined", "ran") } else { ("open     ", "run") };
    writeln!(f, "{head} {count}: borders that {verb} along each other")?;
    for seam in found.iter().take(SHOWN_SEAMS) {
        let [first, last] = seam.vertices;
        writeln!(
            f,
            "          {:.0} mm long, {:.2} mm apart, between vertices {first} and {last}",
            seam.length_mm, seam.gap_mm
        )?;
    }
    if found.len() > SHOWN_SEAMS {
        writeln!(f, "          and {} more", found.len() - SHOWN_SEAMS)?;
    }
    let widest = found.iter().map(|seam| seam.widest_mm).fold(0.0, f64::max);
    match joined {
        true => Ok(()),
        false => {
            writeln!(f, "          join them with --join-seams {:.0}mm", (1.05 * widest).ceil().max(1.0))
        }
    }
}
