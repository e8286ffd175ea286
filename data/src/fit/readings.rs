//! Which candidates look worn, and why the others do not.

use super::cloth::Cloth;
use super::judge::Candidate;
use super::placement::FileOrigin;
use super::search::Search;
use super::sitting::Sitting;

/// Another reading, or height, whose log-posterior is this near to the best is told.
pub(super) const NEAR_TIE: f64 = 6.0;
/// Largest share of a garment that may lie inside the body where it is worn.
pub(super) const MOST_INSIDE: f64 = 0.25;
/// Candidates that are looked at, the best first.
const MOST_READ: usize = 8;
/// A garment touches the body: a twentieth of it is nearer than this (m).
const TOUCHING_DISTANCE: f64 = 0.08;
/// A garment hangs from a rim that is no farther from the body than this, on average (m).
const WIDEST_RIM: f64 = 0.1;
/// A neck opening is no longer than this many times the hem.
const WIDEST_NECK: f64 = 1.5;
/// Least height of a tube around the trunk (m): lower ones are belts.
const LEAST_HEIGHT: f64 = 0.09;

impl Search<'_> {
    /// How a candidate sits, and why it is not believed; `None` if it is.
    pub fn looked_at(&self, cloth: &Cloth, candidate: &Candidate) -> (Sitting, Option<String>) {
        let Candidate { placement, piercing, rim_distance, neck_over_hem, .. } = *candidate;
        let (sitting, height) = self.measured(cloth, &placement);
        // Sleeves made for other arms miss these ones where a file says where it is; a place that was searched for must do without.
        let missed = if placement.origin == FileOrigin::Elsewhere { piercing.arms } else { 0 };
        let bones = piercing.others + missed;
        let reasons = [
            (!candidate.is_worn, "no opening goes around the trunk, the neck or both arms".into()),
            (
                candidate.is_unfounded_turn,
                "turned by 180°, though its neckline does not show its front there".into(),
            ),
            (bones > 0, format!("{bones} bones of the body pass through the cloth")),
            (
                rim_distance > WIDEST_RIM,
                format!(
                    "its upper rim stays {:.0} mm away from the body: nothing holds it",
                    1e3 * rim_distance
                ),
            ),
            (
                neck_over_hem > WIDEST_NECK,
                format!("its neck opening is {neck_over_hem:.1} times as long as its hem: upside down?"),
            ),
            (
                candidate.is_tube && height < LEAST_HEIGHT,
                format!("a band of {:.0} mm around the trunk, such as a belt", 1e3 * height),
            ),
            (
                sitting.inside > MOST_INSIDE,
                format!("{:.0} % of it lies inside the body", 100.0 * sitting.inside),
            ),
            (
                sitting.nearest > TOUCHING_DISTANCE,
                format!("it stays {:.0} mm away from the body", 1e3 * sitting.nearest),
            ),
        ];
        let why = reasons.into_iter().find_map(|(is_so, why): (bool, String)| is_so.then_some(why));
        (sitting, why.or_else(|| self.off_trunk(cloth, &placement).map(str::to_owned)))
    }
}

/// The best readings, the best first.
pub(super) struct Readings {
    pub believed: Vec<Candidate>,
    pub refused: Vec<(Candidate, String)>,
    /// Whether the best one lies on the body as it stands, though nobody wears it there.
    pub is_near: bool,
}

impl Readings {
    pub fn new(candidates: &[Candidate], search: &Search, cloth: &Cloth) -> Self {
        let mut found = Self { believed: Vec::new(), refused: Vec::new(), is_near: false };
        for candidate in candidates.iter().take(MOST_READ) {
            // What is far worse than one that is believed is not looked at.
            if found.believed.first().is_some_and(|best| candidate.score < best.score - NEAR_TIE) {
                break;
            }
            match search.looked_at(cloth, candidate) {
                (_, None) => found.believed.push(*candidate),
                (sitting, Some(why)) => {
                    found.is_near |= found.refused.is_empty()
                        && candidate.placement.origin != FileOrigin::Elsewhere
                        && sitting.inside < MOST_INSIDE
                        && sitting.mean_distance < TOUCHING_DISTANCE;
                    found.refused.push((*candidate, why));
                }
            }
        }
        found
    }
}

/// The best of `candidates` that is believed.
pub(super) fn believed(candidates: &[Candidate], search: &Search, cloth: &Cloth) -> Option<Candidate> {
    Readings::new(candidates, search, cloth).believed.first().copied()
}
