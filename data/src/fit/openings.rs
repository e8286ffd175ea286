//! What a placed garment's openings go around, and what that says: limbs that pass through, the rim it hangs from, its front.

use super::anatomy::Opening;
use super::body_field::LimbTurn;
use super::judge::{Candidate, Judge, UNWORN};
use super::placement::Placement;

/// A border deeper inside the body than this (m), for a larger share of its length, goes around nothing.
const RUNS_THROUGH_DEPTH: f64 = 0.012;
const RUNS_THROUGH_SHARE: f64 = 0.25;

/// A limb passes through openings longer than this (m): a child's wrist.
const NARROWEST_OPENING: f64 = 0.2;

/// A border of a placed garment.
struct Border {
    /// What it goes around; one that runs through the body goes around nothing.
    opening: Opening,
    /// What is linked with it, also if it runs through the body.
    linked: Opening,
    /// Mean height (m).
    height: f64,
    /// Connected piece that it belongs to.
    piece: u32,
}

/// Which limbs pass through openings of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Limbs {
    pub neck: bool,
    /// Both.
    pub arms: bool,
    /// Both.
    pub legs: bool,
}

impl Limbs {
    fn new(openings: &[Border]) -> Self {
        let has = |wanted: Opening| openings.iter().any(|b| b.opening == wanted);
        Self {
            neck: has(Opening::Neck),
            arms: has(Opening::LeftArm) && has(Opening::RightArm),
            legs: has(Opening::LeftLeg) && has(Opening::RightLeg),
        }
    }
}

/// What is not the trunk.
const AROUND_LIMBS: [Opening; 6] = [
    Opening::Neck,
    Opening::LeftArm,
    Opening::RightArm,
    Opening::LeftLeg,
    Opening::RightLeg,
    Opening::Several,
];

/// Whether arms pass through openings of one piece, of more than two: two sleeves apart are socks, and a tube with no other
/// opening has no room for head and legs.
fn has_arms(borders: &[&Border]) -> bool {
    let piece = |wanted| borders.iter().find(|b| b.opening == wanted).map(|b| b.piece);
    let left = piece(Opening::LeftArm);
    borders.len() > 2 && left.is_some() && left == piece(Opening::RightArm)
}

/// Whether a garment of these borders is worn around the trunk; an open shirt hangs from both arms.
fn goes_around(borders: &[&Border]) -> bool {
    let trunk = borders.iter().filter(|b| b.opening == Opening::Trunk).count();
    let is_limb = |border: &&Border| AROUND_LIMBS.contains(&border.opening);
    trunk >= 2 || (trunk > 0 && borders.iter().any(is_limb)) || has_arms(borders)
}

impl Judge<'_> {
    /// The borders of a placed garment.
    fn openings(&self, placement: &Placement) -> Vec<Border> {
        let turn = LimbTurn::of(placement);
        let of_border = |border: usize| {
            let points = placement.apply(&self.cloth.border(border));
            let count = points.len().max(1) as f64;
            let inside =
                points.iter().filter(|p| self.field.is_inside(**p, turn, RUNS_THROUGH_DEPTH)).count();
            let linked = self.skeleton.opening(&points, turn);
            Border {
                opening: if inside as f64 > RUNS_THROUGH_SHARE * count { Opening::Nothing } else { linked },
                linked,
                height: points.iter().map(|p| p[1]).sum::<f64>() / count,
                piece: self.cloth.piece(border),
            }
        };
        (0..self.cloth.borders.len()).map(of_border).collect()
    }

    /// Which limbs pass through openings of their own.
    pub fn limbs(&self, placement: &Placement) -> Limbs {
        Limbs::new(&self.openings(placement))
    }

    /// For every border whether a limb passes through it.
    pub fn is_linked(&self, placement: &Placement) -> Vec<bool> {
        self.openings(placement).iter().map(|border| border.linked != Opening::Nothing).collect()
    }

    /// Whether limbs pass through its openings, and which rim it hangs from; the candidate's score does not count that yet.
    pub fn with_openings(&self, mut candidate: Candidate) -> Candidate {
        let openings = self.openings(&candidate.placement);
        let all: Vec<&Border> = openings.iter().collect();
        let count = |wanted: Opening| openings.iter().filter(|b| b.opening == wanted).count();
        let has = |wanted: Opening| count(wanted) > 0;
        let arms = has_arms(&all);
        // Only sleeves and armholes tell how arms hang.
        let is_worn = goes_around(&all) && (arms || candidate.placement.arm_angle_degrees == 0.0);
        if !is_worn {
            candidate.score -= UNWORN;
        }
        candidate.is_worn = is_worn;
        candidate.worn_pieces = worn_alone(&openings).len();
        let longest = |wanted: Opening| {
            let of = openings.iter().zip(&self.cloth.border_lengths).filter(|(b, _)| b.linked == wanted);
            of.map(|(_, length)| *length).fold(0.0, f64::max)
        };
        let hem = longest(Opening::Trunk);
        candidate.neck_over_hem = if hem > 0.0 { longest(Opening::Neck) / hem } else { 0.0 };
        candidate.is_tube = count(Opening::Trunk) == 2 && !AROUND_LIMBS.into_iter().any(has);
        let is_wide = |border: &usize| {
            self.cloth.border_lengths[*border] * candidate.placement.unit.metres() > NARROWEST_OPENING
        };
        let is_idle = |border: &usize| openings[*border].opening == Opening::Nothing && is_wide(border);
        candidate.idle_openings = (0..openings.len()).filter(is_idle).count();
        candidate.neck_drop = (has(Opening::Neck) || arms).then(|| self.neck_drop(&candidate.placement));
        candidate.rim = None;
        if !has(Opening::Neck) && !arms {
            let trunk = openings.iter().enumerate().filter(|(_, b)| b.opening == Opening::Trunk);
            candidate.rim = trunk.max_by(|a, b| a.1.height.total_cmp(&b.1.height)).map(|(border, _)| border);
        }
        candidate
    }

    /// Connected pieces that would be worn without the others.
    pub fn worn_pieces(&self, placement: &Placement) -> Vec<u32> {
        worn_alone(&self.openings(placement))
    }

    /// How much lower the cloth ends in front of the spine than behind it, where it meets the middle plane of the body (m).
    fn neck_drop(&self, placement: &Placement) -> f64 {
        let placed = placement.apply(self.cloth.positions);
        // Where there is no cloth in front, it ends at the hem.
        let mut tops = [self.field.levels.waist; 2];
        for face in self.cloth.faces {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let [a, b] = [a, b].map(|corner| placed[face[corner] as usize]);
                if (a[0] < 0.0) != (b[0] < 0.0) {
                    let share = a[0] / (a[0] - b[0]);
                    let [y, z] = [1, 2].map(|k| a[k] + share * (b[k] - a[k]));
                    let top = &mut tops[usize::from(z > self.field.spine_z)];
                    *top = top.max(y);
                }
            }
        }
        tops[0] - tops[1]
    }
}

/// Connected pieces that would be worn without the others.
fn worn_alone(borders: &[Border]) -> Vec<u32> {
    let mut pieces: Vec<u32> = borders.iter().map(|border| border.piece).collect();
    pieces.sort_unstable();
    pieces.dedup();
    pieces.retain(|piece| {
        let own: Vec<&Border> = borders.iter().filter(|border| border.piece == *piece).collect();
        goes_around(&own)
    });
    pieces
}
