//! Which placement is taken, what else it could be, and when none is believed.

use super::cloth::Cloth;
use super::diagnosis::size_doubt;
use super::doubt::{Doubt, SAME};
use super::error::FitError;
use super::judge::Candidate;
use super::placement::{Origin, Placement, Unit};
use super::search::Search;
use super::settings::FitSettings;
use super::sitting::Sitting;
use clothcombo_physics::vec3::{norm, sub};

/// Another reading, or height, whose log-posterior is this near to the best is told.
const NEAR_TIE: f64 = 6.0;
/// Largest share of a garment that may lie inside the body where it is worn.
const MOST_INSIDE: f64 = 0.25;
/// Candidates that are looked at, the best first.
const READ: usize = 8;
/// A garment touches the body: a twentieth of it is nearer than this (m).
const FARTHEST: f64 = 0.08;
/// What lies on a part of the body is no farther from it, on average (m).
const SNUG: f64 = 0.03;
/// A garment hangs from a rim that is no farther from the body than this, on average (m).
const WIDEST_RIM: f64 = 0.1;
/// A neck opening is no longer than this many times the hem.
const WIDEST_NECK: f64 = 1.5;
/// Limbs that are held otherwise explain that much more (log-posterior), or are doubted.
const LIMB_EVIDENCE: f64 = 12.0;
/// Least height of a tube around the trunk (m): lower ones are belts.
const LEAST_HEIGHT: f64 = 0.09;

/// Why a candidate is not believed; `None` if it is.
pub(super) fn implausibility(
    candidate: &Candidate,
    sitting: &Sitting,
    height: f64,
    off_trunk: Option<&str>,
) -> Option<String> {
    let percent = |share: f64| 100.0 * share;
    if !candidate.is_worn {
        return Some("no opening goes around the trunk, the neck or both arms".into());
    }
    if candidate.is_unfounded_turn {
        return Some("turned by 180°, though its neckline does not show its front there".into());
    }
    // Sleeves made for other arms miss these ones where a file says where it is; a place that was searched for must do without.
    let missed = if candidate.placement.origin == Origin::Elsewhere { candidate.piercing.arms } else { 0 };
    let piercing = candidate.piercing.others + missed;
    if piercing > 0 {
        return Some(format!("{piercing} bones of the body pass through the cloth"));
    }
    if candidate.rim_distance > WIDEST_RIM {
        return Some(format!(
            "its upper rim stays {:.0} mm away from the body: nothing holds it",
            1e3 * candidate.rim_distance
        ));
    }
    if candidate.neck_over_hem > WIDEST_NECK {
        return Some(format!(
            "its neck opening is {:.1} times as long as its hem: upside down?",
            candidate.neck_over_hem
        ));
    }
    if candidate.is_tube && height < LEAST_HEIGHT {
        return Some(format!("a band of {:.0} mm around the trunk, such as a belt", 1e3 * height));
    }
    if sitting.inside > MOST_INSIDE {
        return Some(format!("{:.0} % of it lies inside the body", percent(sitting.inside)));
    }
    if sitting.nearest > FARTHEST {
        return Some(format!("it stays {:.0} mm away from the body", 1e3 * sitting.nearest));
    }
    off_trunk.map(str::to_owned)
}

/// Where a file as it stands lies snugly on head, arms or feet: a band around the head is none around the chest of another unit.
fn lies_off_trunk(candidate: &Candidate, search: &Search, cloth: &Cloth) -> Option<&'static str> {
    if candidate.placement.origin == Origin::Elsewhere || !cloth.is_tubes() {
        return None;
    }
    let place = search.off_trunk(cloth, &candidate.placement)?;
    let (sitting, _) = search.measured(cloth, &candidate.placement);
    (sitting.inside < MOST_INSIDE && sitting.mean_distance < SNUG).then_some(place)
}

/// A placement and the doubts about it.
pub(super) struct Verdict {
    pub placement: Placement,
    pub doubts: Vec<Doubt>,
}

impl Verdict {
    /// Whether it is taken because hints say so, though it does not look worn.
    pub fn is_odd(&self) -> bool {
        self.doubts.iter().any(|doubt| matches!(doubt, Doubt::Odd { .. }))
    }
}

/// The best readings, the best first.
pub(super) struct Readings {
    pub believed: Vec<Candidate>,
    refused: Vec<(Candidate, String)>,
    /// Whether the best one lies on the body as it stands, though nobody wears it there.
    is_near: bool,
}

impl Readings {
    pub fn new(candidates: &[Candidate], search: &Search, cloth: &Cloth) -> Self {
        let (mut believed, mut refused): (Vec<Candidate>, Vec<(Candidate, String)>) = Default::default();
        let mut is_near = false;
        for candidate in candidates.iter().take(READ) {
            // What is far worse than one that is believed is not looked at.
            if believed.first().is_some_and(|best| candidate.score < best.score - NEAR_TIE) {
                break;
            }
            let (sitting, height) = search.measured(cloth, &candidate.placement);
            let off_trunk = search.off_trunk(cloth, &candidate.placement);
            match implausibility(candidate, &sitting, height, off_trunk) {
                None => believed.push(*candidate),
                Some(why) => {
                    is_near |= refused.is_empty()
                        && candidate.placement.origin != Origin::Elsewhere
                        && sitting.inside < MOST_INSIDE
                        && sitting.mean_distance < FARTHEST;
                    refused.push((*candidate, why));
                }
            }
        }
        Self { believed, refused, is_near }
    }
}

/// Takes the best of `candidates`, the best first.
///
/// # Errors
/// [`FitError::Implausible`] and [`FitError::OffTrunk`] if none is believed.
pub(super) fn verdict(
    candidates: &[Candidate],
    search: &Search,
    cloth: &Cloth,
    settings: &FitSettings,
) -> Result<Verdict, FitError> {
    let Readings { believed, refused, is_near } = Readings::new(candidates, search, cloth);
    let mut doubts = Vec::new();
    let Some(candidate) = believed.first().or(refused.first().map(|(best, _)| best)).copied() else {
        return Err(FitError::Implausible { best: "none".into(), second: None });
    };
    if let (true, Some((best, why))) = (believed.is_empty(), refused.first()) {
        if !settings.says_place() {
            // A hat or a sock that lies where it is worn is called one.
            let is_metres = best.placement.unit == Unit::M;
            if let (true, Some(place)) =
                (is_near && is_metres && cloth.is_tubes(), search.off_trunk(cloth, &best.placement))
            {
                return Err(FitError::OffTrunk { place });
            }
            let mut readings = refused.iter().map(|(c, why)| format!("{} ({why})", c.placement.reading()));
            let best = readings.next().unwrap_or_default();
            return Err(FitError::Implausible { best, second: readings.next() });
        }
        doubts.push(Doubt::Odd { why: why.clone() });
    }
    if let Some(size) = size_doubt(search, cloth, settings, &candidate) {
        match settings.says_place() || !size.is_refused() {
            true => doubts.push(Doubt::Size(size)),
            false => return Err(FitError::Size { size }),
        }
    }
    let is_usual = candidate.placement.origin != Origin::Elsewhere || settings.offset.is_some();
    let (candidate, least_loss) = match is_usual {
        true => (candidate, f64::INFINITY),
        false => search.probed(cloth, settings, candidate),
    };
    if candidate.is_tube
        && !is_usual
        && let Some(place) = candidates.iter().find_map(|c| lies_off_trunk(c, search, cloth))
    {
        return Err(FitError::OffTrunk { place });
    }
    let taken = candidate.placement;
    let points = search.level(cloth, &taken);
    let apart = |other: &Placement| {
        let other = search.level(cloth, other);
        let mut apart: Vec<f64> = other.iter().zip(&points).map(|(a, b)| norm(sub(*a, *b))).collect();
        apart.sort_by(f64::total_cmp);
        // Sleeves are a small part of a garment.
        apart.get(apart.len() * 19 / 20).copied().unwrap_or(0.0)
    };
    let other = believed.iter().skip(1).map(|c| (c.placement, apart(&c.placement))).find(|(_, d)| *d > SAME);
    if let Some((other, apart)) = other {
        doubts.push(Doubt::NearTie { taken, other, apart });
    }
    if least_loss < NEAR_TIE {
        doubts.push(Doubt::Height { taken });
    }
    if candidate.is_tube && settings.category.is_none() && !is_usual {
        doubts.push(Doubt::Tube);
    }
    if candidate.worn_pieces > 1 {
        doubts.push(Doubt::Outfit { pieces: candidate.worn_pieces });
    }
    if candidate.piercing.arms > 0 {
        doubts.push(Doubt::Arms);
    }
    if taken.turn_degrees == 180.0 && settings.turn_degrees.is_none() && candidate.neck_drop.is_none() {
        doubts.push(Doubt::Turned);
    }
    // Those that are hinted at are alike in all candidates.
    let held = |c: &Candidate| (c.placement.arm_angle_degrees != 0.0, c.placement.leg_angle_degrees != 0.0);
    let otherwise = candidates.iter().find(|c| held(c) != held(&candidate));
    let margin = otherwise.map_or(f64::MAX, |other| candidate.score - other.score);
    if held(&candidate) != (false, false) && margin < LIMB_EVIDENCE {
        doubts.push(Doubt::Limbs { taken, margin });
    }
    Ok(Verdict { placement: taken, doubts })
}
