//! A design cut for a body.

use super::design::GarmentDesign;
use super::fit::BodyFit;
use super::pattern::Pattern;
use super::{lower, upper};

/// Cuts `design` for a body; `edge_length` (m) is what the mesh will have, which seams, straps and pleats have to respect,
/// `clearance` (m) the least distance from the skin.
pub(super) fn cut_pattern<'a>(
    fit: &'a BodyFit,
    design: &GarmentDesign,
    edge_length: f64,
    clearance: f64,
) -> Pattern<'a> {
    // A flat triangle over a limb of 5 cm radius dips this much below its corners.
    let sag = edge_length * edge_length / (8.0 * 0.05);
    let mut pattern = Pattern::blank(fit, clearance + sag);
    match design {
        GarmentDesign::Skirt(skirt) => lower::cut_skirt(&mut pattern, skirt, edge_length, sag),
        GarmentDesign::Trousers(trousers) => lower::cut_trousers(&mut pattern, trousers, sag),
        GarmentDesign::Upper(design) => upper::cut(&mut pattern, design, edge_length, sag),
    }
    pattern
}
