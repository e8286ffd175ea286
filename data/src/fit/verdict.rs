//! Which placement is taken, what else it could be, and when none is believed.

use super::cloth::Cloth;
use super::diagnosis::size_doubt;
use super::error::FitError;
use super::judge::Candidate;
use super::placement::{FileOrigin, Placement, Unit};
use super::readings::{MOST_INSIDE, NEAR_TIE, Readings};
use super::report::outfit_warning;
use super::search::Search;
use super::settings::FitSettings;
use clothcombo_physics::vec3::{norm, sub};

/// What lies on a part of the body is no farther from it, on average (m).
const SNUG: f64 = 0.03;
/// Readings nearer to each other than this are the same (m).
const SAME_READING: f64 = 0.02;
/// Limbs that are held otherwise explain that much more (log-posterior), or are doubted.
const LIMB_EVIDENCE: f64 = 12.0;

/// Of a file that says where it is on the body, where arms miss the sleeves.
pub(super) const ARMS_MISS: &str = "arms of the body pass through the cloth of its sleeves, which were made for arms held \
    otherwise or of another body: --arms or --from-body settles it";

/// Where a file as it stands lies snugly on head, arms or feet: a band around the head is none around the chest of another unit.
fn lies_off_trunk(candidate: &Candidate, search: &Search, cloth: &Cloth) -> Option<&'static str> {
    if candidate.placement.origin == FileOrigin::Elsewhere || !cloth.is_tubes() {
        return None;
    }
    let place = search.off_trunk(cloth, &candidate.placement)?;
    let (sitting, _) = search.measured(cloth, &candidate.placement);
    (sitting.inside < MOST_INSIDE && sitting.mean_distance < SNUG).then_some(place)
}

/// A placement, and what is not certain about it, with the flags that settle it.
pub(super) struct PlacementVerdict {
    pub placement: Placement,
    pub doubts: Vec<String>,
    /// Whether it is taken because hints say so, though it does not look worn.
    pub is_odd: bool,
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
) -> Result<PlacementVerdict, FitError> {
    let Readings { believed, refused, is_near } = Readings::new(candidates, search, cloth);
    let mut doubts: Vec<String> = Vec::new();
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
        doubts.push(format!("it does not look worn there: {why}; the hints are taken all the same"));
    }
    if let Some(size) = size_doubt(search, cloth, settings, &candidate) {
        match settings.says_place() || !size.is_refused() {
            true => doubts.push(format!("{size}: is it of another size, or in another unit (--unit)?")),
            false => return Err(FitError::Size { size }),
        }
    }
    let is_usual = candidate.placement.origin != FileOrigin::Elsewhere || settings.offset.is_some();
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
    doubts.extend(near_tie(&candidate, &believed, search, cloth));
    if least_loss < NEAR_TIE {
        doubts.push(format!(
            "its height is known to 3 cm only: look at it; {} takes it, another y moves it",
            offset_flag(&candidate.placement)
        ));
    }
    if candidate.is_tube && settings.category.is_none() && !is_usual {
        doubts.push(
            "a tube with two openings may be a skirt at the waist or a strapless top at the chest; --category settles it"
                .into(),
        );
    }
    doubts.extend(worn_otherwise(&candidate, candidates, settings));
    Ok(PlacementVerdict { placement: candidate.placement, doubts, is_odd: believed.is_empty() })
}

/// Another reading that is nearly as good as the one taken.
fn near_tie(taken: &Candidate, believed: &[Candidate], search: &Search, cloth: &Cloth) -> Option<String> {
    let taken = taken.placement;
    let points = search.level(cloth, &taken);
    let apart = |other: &Placement| {
        let other = search.level(cloth, other);
        let mut apart: Vec<f64> = other.iter().zip(&points).map(|(a, b)| norm(sub(*a, *b))).collect();
        apart.sort_by(f64::total_cmp);
        // Sleeves are a small part of a garment.
        apart.get(apart.len() * 19 / 20).copied().unwrap_or(0.0)
    };
    let mut others = believed.iter().skip(1).map(|c| (c.placement, apart(&c.placement)));
    others.find(|(_, apart)| *apart > SAME_READING).map(|(other, apart)| {
        format!(
            "another placement, up to {:.0} mm away, fits nearly as well: {}; {} settles it",
            1e3 * apart,
            other.reading(),
            differences(&taken, &other).join(" ")
        )
    })
}

/// What is not certain about how a candidate is worn: by itself, by these arms, this way round, with limbs held so.
fn worn_otherwise(taken: &Candidate, candidates: &[Candidate], settings: &FitSettings) -> Vec<String> {
    let mut doubts: Vec<String> = outfit_warning(taken.worn_pieces).into_iter().collect();
    let placement = &taken.placement;
    if taken.piercing.arms > 0 {
        doubts.push(ARMS_MISS.into());
    }
    if placement.turn_degrees == 180.0 && settings.turn_degrees.is_none() && taken.neck_drop.is_none() {
        doubts.push(
            "turned by 180°, as it lies better on the body so, though no neckline shows where its front is; --turn 0 keeps it"
                .into(),
        );
    }
    // Those that are hinted at are alike in all candidates.
    let held = |c: &Candidate| (c.placement.arm_angle_degrees != 0.0, c.placement.leg_angle_degrees != 0.0);
    let otherwise = candidates.iter().find(|c| held(c) != held(taken));
    let margin = otherwise.map_or(f64::MAX, |other| taken.score - other.score);
    if !placement.has_limbs_at_rest() && margin < LIMB_EVIDENCE {
        let (limbs, flag, angle) = match placement.arm_angle_degrees {
            0.0 => ("legs", "--legs 0", placement.leg_angle_degrees),
            angle => ("arms", "--arms t", angle),
        };
        doubts.push(format!(
            "little tells that its {limbs} are {angle:.0}° from the rest pose (log-odds {margin:.1}); {flag} if they are not"
        ));
    }
    doubts
}

/// Flags by which the placement taken differs from another, as they fix the one taken.
fn differences(taken: &Placement, other: &Placement) -> Vec<String> {
    let level = |p: &Placement| p.arm_angle_degrees == 0.0;
    let together = |p: &Placement| p.leg_angle_degrees == 0.0;
    let flags = [
        (taken.unit != other.unit, format!("--unit {}", taken.unit)),
        (taken.up != other.up, format!("--up {}", taken.up)),
        (taken.turn_degrees != other.turn_degrees, format!("--turn {}", taken.turn_degrees)),
        (level(taken) != level(other), format!("--arms {}", if level(taken) { "t" } else { "a" })),
        (together(taken) != together(other), format!("--legs {:.0}", taken.leg_angle_degrees)),
    ];
    let flags: Vec<String> =
        flags.into_iter().filter_map(|(differs, flag)| differs.then_some(flag)).collect();
    match flags.is_empty() {
        true if norm(sub(taken.translation, other.translation)) < SAME_READING => {
            vec!["--from-body with the body it was made on".into()]
        }
        true => vec![offset_flag(taken)],
        false => flags,
    }
}

fn offset_flag(taken: &Placement) -> String {
    let [x, y, z] = taken.translation;
    format!("--offset {x:.3},{y:.3},{z:.3}")
}
