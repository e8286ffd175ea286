//! Files as they stand: their origin lies at one of the usual points, or where it is said to be, and nothing is searched for.

use super::climb::{ClimbSteps, Moves, climbed};
use super::cloth::Cloth;
use super::judge::{Candidate, Judge, UNWORN};
use super::placement::{FileOrigin, Placement};
use super::search::{ARM_ANGLES, Search};
use super::settings::FitSettings;
use crate::mesh::{outward_area, triangle_normal};
use clothcombo_physics::vec3::norm;
use rayon::prelude::*;

/// Least share of a sheet's area that faces one way.
const SHEET_SHARE: f64 = 0.5;

impl Search<'_> {
    /// How a garment is judged that is in metres, T-pose and the body's frame; or why nobody wears it there.
    pub fn believed_as_given(&self, cloth: &Cloth, settings: &FitSettings) -> Result<Candidate, String> {
        let candidate = self.judged_as_given(&self.judge(cloth, settings), Placement::AS_GIVEN);
        self.looked_at(cloth, &candidate).1.map_or(Ok(candidate), Err)
    }

    /// Files as they stand: their origin at one of the usual points, or where it is said to be; arms level, and where the
    /// garment fits arms that hang better.
    pub fn usual(&self, bases: &[Placement], judge: &Judge) -> Vec<Placement> {
        let floor = self.measured.field.low[1];
        let places = match judge.settings.offset {
            Some(offset) => vec![(FileOrigin::Elsewhere, offset)],
            None => vec![(FileOrigin::Pelvis, [0.0; 3]), (FileOrigin::Floor, [0.0, floor, 0.0])],
        };
        let lowered = judge.settings.arms_lowered;
        let at = |base: &Placement| -> Vec<Placement> {
            let stands = places.iter().map(|(origin, translation)| Placement {
                origin: *origin,
                translation: *translation,
                ..*base
            });
            let level = stands.clone().filter(|_| lowered != Some(true));
            let hanging = stands.filter(|_| lowered != Some(false)).filter_map(|p| self.with_arms(p, judge));
            level.chain(hanging).collect()
        };
        bases.par_iter().flat_map_iter(at).collect()
    }

    /// The same with arms at the angle that fits best, if a garment that lies there has sleeves or armholes.
    fn with_arms(&self, placement: Placement, judge: &Judge) -> Option<Placement> {
        let turned = judge.turned(&placement, None, false);
        let scored = |degrees: &f64| {
            let at = Placement { arm_angle_degrees: *degrees, ..placement };
            judge.scored(Candidate::at(at), &turned, true)
        };
        let angles = ARM_ANGLES.iter().filter(|degrees| **degrees != 0.0).map(scored);
        let best = angles.max_by(|a, b| a.score.total_cmp(&b.score))?;
        let steps = ClimbSteps { from: 0.06, to: 0.004, is_sharp: true, is_fine: false, moves: Moves::Limbs };
        let climbed = judge.with_openings(climbed(judge, &best, &steps));
        (climbed.is_worn || judge.settings.arms_lowered == Some(true)).then_some(climbed.placement)
    }

    /// A file as it stands counts as worn if it lies around the trunk, however its borders run.
    pub fn judged_as_given(&self, judge: &Judge, placement: Placement) -> Candidate {
        let candidate = judge.judged(placement);
        match candidate.is_worn || !self.is_sheet_around(judge.cloth, &placement) {
            true => candidate,
            false => {
                // It has no sleeves that arms could miss.
                let piercing = candidate.piercing.anywhere();
                Candidate { score: candidate.score + UNWORN, is_worn: true, piercing, ..candidate }
            }
        }
    }

    /// Whether cloth lies snugly around the trunk with one of its sides outwards; half of a rope's surface faces the body.
    fn is_sheet_around(&self, cloth: &Cloth, placement: &Placement) -> bool {
        if !self.measured(cloth, placement).0.is_snug() {
            return false;
        }
        let placed = placement.apply(cloth.positions);
        let net = outward_area(&placed, cloth.faces, cloth.topology, self.surface());
        let area = |f: &[u32; 3]| 0.5 * norm(triangle_normal(f.map(|v| placed[v as usize])));
        let total: f64 = cloth.faces.iter().map(area).sum();
        net.iter().map(|area| area.abs()).sum::<f64>() > SHEET_SHARE * total
    }
}
