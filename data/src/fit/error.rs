//! Why a mesh is no garment of a body.

use super::pieces::StrayPiece;
use super::placement::{Unit, UpAxis};
use super::settings::{MAX_GARMENT_VERTICES, MIN_TRIANGLES, MOST_STRETCH};
use std::fmt;
use thiserror::Error;

/// Clothes that are worn are not this many times as large or small as those that fit.
const OTHER_SIZE: f64 = 1.6;

/// A garment of another size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Its largest extent (m), in this unit.
    pub extent: f64,
    /// Unit in which that is.
    pub unit: Unit,
    /// Factor at which it would fit.
    pub factor: f64,
}

impl Size {
    /// How many times too large or too small it is.
    pub(super) fn ratio(&self) -> f64 {
        self.factor.max(1.0 / self.factor)
    }

    /// Whether nobody of this body's size wears it.
    pub(super) fn is_refused(&self) -> bool {
        self.ratio() > OTHER_SIZE
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { extent, unit, factor } = self;
        write!(
            f,
            "it measures {extent:.2} m from end to end (unit {unit}), and fits much better scaled by about {factor:.2}"
        )
    }
}

/// Why a mesh is not fitted.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FitError {
    /// Too many vertices.
    #[error(
        "{vertices} vertices, more than the {MAX_GARMENT_VERTICES} a garment may have; decimate it first"
    )]
    TooManyVertices {
        /// After welding.
        vertices: usize,
    },
    /// Too few triangles.
    #[error("not a garment: {triangles} triangles with an area, a garment has at least {MIN_TRIANGLES}")]
    TooFewTriangles {
        /// After cleaning.
        triangles: usize,
    },
    /// Hardly any of its triangles are connected.
    #[error(
        "not a garment: {pieces} loose pieces of {triangles} triangles, where cloth is connected; do its faces name the right vertices?"
    )]
    Scattered {
        /// Connected pieces.
        pieces: usize,
        /// Of all of them.
        triangles: usize,
    },
    /// No opening.
    #[error(
        "not a garment: a closed surface without any opening (a body, a solid, or cloth with thickness: then keep its outer \
         layer only)"
    )]
    Closed,
    /// As large as no garment of this body.
    #[error(
        "not a garment of this body: its largest extent is {extent:.4} in the file's unit{}; the body is {reach:.2} m large",
         unit.map(|u| format!(", {:.2} m for {u}", extent * u.metres())).unwrap_or_default()
    )]
    Extent {
        /// Largest extent in the file's unit.
        extent: f64,
        /// The unit, if given.
        unit: Option<Unit>,
        /// Largest extent of the body (m).
        reach: f64,
    },
    /// The body to fit to is none that clothes can be placed on.
    #[error("the body: {0}")]
    ImplausibleBody(String),
    /// Reaches from head to feet and to both hands.
    #[error("not a garment: it reaches from the crown to the soles and to both hands, as a body does")]
    Body,
    /// Covers neither trunk nor hips, as each of the six categories does.
    #[error("not one of the six garment categories: {place}; if it is one, --category says which")]
    OffTrunk {
        /// Where it lies.
        place: &'static str,
    },
    /// A connected piece lies beside the body, or far from it.
    #[error("{piece}: {}", piece.hint())]
    StrayPiece {
        /// Which piece, and where it lies.
        piece: StrayPiece,
    },
    /// It is worn at another size only.
    #[error("not of this body's size: {size}; if it is to be worn so, say how: --unit, --offset, --category")]
    Size {
        /// What it measures, and what would fit.
        size: Size,
    },
    /// It is worn when the file is turned upside down.
    #[error("upside down: with --up {up} it would be worn, and nowhere as it is")]
    UpsideDown {
        /// The axis that points up then.
        up: UpAxis,
    },
    /// One half of a garment.
    #[error(
        "half a garment: all of it lies on one side of {axis} = {at:.4}, and {:.0} % of a border runs there; apply the mirror modifier, or \
         export both halves", 100.0 * share
    )]
    Half {
        /// Axis of the file across which it is cut.
        axis: char,
        /// Where it is cut, in the file's unit.
        at: f64,
        /// Share of the border's length on the cut.
        share: f64,
    },
    /// No placement is believed.
    #[error(
        "no placement on this body looks worn; the best: {best}{}; hints, if it is a garment of the six categories: --unit, --up, \
         --turn, --arms, --offset, --category, or --from-body with the body it was made on",
        second.as_ref().map(|s| format!("; the second: {s}")).unwrap_or_default()
    )]
    Implausible {
        /// The best reading and what speaks against it.
        best: String,
        /// The second best.
        second: Option<String>,
    },
    /// Too small, or no garment in this placement.
    #[error(
        "does not fit this body: {:.0} % of its edges would be longer than {MOST_STRETCH} times their length once it is outside of \
         the body", 100.0 * share
    )]
    Stretched {
        /// Share of the edges.
        share: f64,
    },
    /// Two sheets, where a garment is one.
    #[error(
        "cloth with thickness: two sheets {thickness:.4} apart in the file's unit ({:.1} % of its size) that face away from each \
         other, where a garment is one sheet; --keep outer takes the outer one", 100.0 * share
    )]
    Thickness {
        /// Median distance of the sheets in the file's unit.
        thickness: f64,
        /// The same as a share of the diagonal.
        share: f64,
    },
    /// Two pieces that lie in each other all over.
    #[error(
        "two sheets of cloth {distance:.4} apart in the file's unit ({:.1} % of its size), such as a lining or two garments in one \
         file, where a garment is one sheet; --keep largest takes the largest piece", 100.0 * share
    )]
    Sheets {
        /// Median distance of the pieces in the file's unit.
        distance: f64,
        /// The same as a share of the diagonal.
        share: f64,
    },
    /// Thick cloth whose sheets cannot be told apart.
    #[error(
        "cloth with thickness whose outer and inner sheet cannot be told apart: delete the inner sheet and the rims in a modelling \
         program"
    )]
    MixedSheets,
    /// The body that the garment was made on does not say where it lies.
    #[error("--from-body {name}: {what}")]
    SourceBody {
        /// Its file, with shape parameters where some were given.
        name: String,
        /// What is wrong, and what to do.
        what: String,
    },
    /// No mesh after the repairs.
    #[error("no mesh is left: {0}")]
    Mesh(String),
}
