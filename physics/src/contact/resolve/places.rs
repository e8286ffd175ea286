//! The better of two states of an outfit, place by place.
//!
//! One attempt mends the armpit and another one the knee. What differs between two states falls into places that neither
//! edges nor crossings link; each place can be taken from the state that has it better.

use super::Layer;
use super::certificate::{Certificate, Crossed};
use super::outfit::Outfit;

/// Faces of two garments, or of one, that cross; a face of the body is left out. Packed numbers.
pub(super) struct Crossing {
    pub faces: [u32; 2],
    /// Whether it is of one garment with itself.
    pub is_own: bool,
}

impl Crossing {
    pub fn with_body(face: u32) -> Self {
        Self { faces: [face, face], is_own: false }
    }

    pub fn between(faces: (u32, u32)) -> Self {
        Self { faces: [faces.0, faces.1], is_own: false }
    }

    pub fn own(faces: (u32, u32)) -> Self {
        Self { faces: [faces.0, faces.1], is_own: true }
    }
}

/// One of two states.
pub(super) struct State<'a> {
    /// By packed vertex.
    pub positions: &'a [[f64; 3]],
    pub crossings: &'a [Crossing],
}

/// Crossings of a place: with the body and between garments, then of garments with themselves.
pub(super) type Wrong = (usize, usize);

/// What is wrong altogether.
pub(super) fn count(crossings: &[Crossing]) -> Wrong {
    let own = crossings.iter().filter(|crossing| crossing.is_own).count();
    (crossings.len() - own, own)
}

/// For every packed vertex whether it is taken from `other` instead of `one`: `is_better` is asked with what is wrong in a
/// place in `one` and in `other`.
pub(super) fn by_place(
    outfit: &Outfit<'_>,
    one: &State<'_>,
    other: &State<'_>,
    is_better: impl Fn(Wrong, Wrong) -> bool,
) -> Vec<bool> {
    let differs: Vec<bool> = one.positions.iter().zip(other.positions).map(|(a, b)| a != b).collect();
    let mut places = Places { parent: (0..differs.len() as u32).collect() };
    outfit.faces.iter().for_each(|face| places.link(face.iter().copied().filter(|v| differs[*v as usize])));
    let corners = |crossing: &Crossing| {
        let differs = &differs;
        let faces = crossing.faces.map(|f| outfit.faces[f as usize]);
        faces.into_iter().flatten().filter(move |v| differs[*v as usize])
    };
    one.crossings.iter().chain(other.crossings).for_each(|crossing| places.link(corners(crossing)));

    let mut wrong = vec![[(0, 0); 2]; differs.len()];
    for (side, state) in [one, other].into_iter().enumerate() {
        for crossing in state.crossings {
            // All its corners that differ are in one place; without any it is in both states.
            let Some(v) = corners(crossing).next() else { continue };
            let counts: &mut Wrong = &mut wrong[places.of(v) as usize][side];
            match crossing.is_own {
                true => counts.1 += 1,
                false => counts.0 += 1,
            }
        }
    }
    let mut is_taken = |v: u32| {
        let [of_one, of_other] = wrong[places.of(v) as usize];
        is_better(of_one, of_other)
    };
    (0..differs.len() as u32).map(|v| differs[v as usize] && is_taken(v)).collect()
}

/// The better of two states with their certificates in every place, by crossings; `None` where that is all of one of them.
pub(super) fn best_places(
    layers: &[Layer<'_>],
    one: (&[Vec<[f64; 3]>], &Certificate),
    other: (&[Vec<[f64; 3]>], &Certificate),
) -> Option<Vec<Vec<[f64; 3]>>> {
    let outfit = Outfit::new(layers);
    let packed = |positions: &[Vec<[f64; 3]>]| positions.concat();
    let crossings = |certificate: &Certificate| -> Vec<Crossing> {
        let of = |g: usize, f: usize| outfit.faces_of_garment(g).start + f as u32;
        let left = certificate.remaining.iter().filter(|pair| !pair.is_pinched);
        left.map(|pair| {
            let face = of(pair.garment, pair.triangle);
            match pair.crosses {
                Crossed::Body => Crossing::with_body(face),
                Crossed::Layer(g) => Crossing::between((face, of(g, pair.other_triangle))),
                Crossed::Itself => Crossing::own((face, of(pair.garment, pair.other_triangle))),
            }
        })
        .collect()
    };
    let (mut positions, others) = (packed(one.0), packed(other.0));
    let taken = by_place(
        &outfit,
        &State { positions: &positions, crossings: &crossings(one.1) },
        &State { positions: &others, crossings: &crossings(other.1) },
        |of_one, of_other| of_other < of_one,
    );
    let mut is_mixed = [false; 2];
    for ((p, other), taken) in positions.iter_mut().zip(&others).zip(taken) {
        is_mixed[usize::from(taken)] |= *p != *other;
        if taken {
            *p = *other;
        }
    }
    is_mixed
        .iter()
        .all(|m| *m)
        .then(|| (0..outfit.len()).map(|g| outfit.part(&positions, g).to_vec()).collect())
}

/// Vertices that hang together (union–find).
struct Places {
    parent: Vec<u32>,
}

impl Places {
    fn of(&mut self, v: u32) -> u32 {
        let mut root = v;
        while self.parent[root as usize] != root {
            // Halving the path keeps it short.
            let next = self.parent[self.parent[root as usize] as usize];
            self.parent[root as usize] = next;
            root = next;
        }
        root
    }

    fn link(&mut self, mut vertices: impl Iterator<Item = u32>) {
        let Some(first) = vertices.next() else { return };
        for v in vertices {
            let (a, b) = (self.of(first), self.of(v));
            // The smaller number is the root, whatever the order.
            self.parent[a.max(b) as usize] = a.min(b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Layer, RestGarment, certify};
    use super::*;
    use crate::mesh::shapes;
    use crate::query::Surface;
    use crate::vec3::add;

    /// Two balls 40 cm apart, and the middle of their tops.
    fn body() -> Surface<f64> {
        let ball = shapes::icosphere(0.1, 3);
        let other = shapes::mapped(&ball, |p| add(p, [0.4, 0.0, 0.0]));
        Surface::from_mesh(&shapes::union(&[&ball, &other]))
    }

    /// A level sheet over both balls, at a height over the left one and one over the right one, between which it is at `middle`.
    fn sheet(left: f64, right: f64, middle: f64) -> crate::mesh::TriMesh {
        let grid = shapes::grid(0.6, 0.2, 30, 10);
        let height = |x: f64| match x {
            x if x < 0.15 => left,
            x if x > 0.25 => right,
            _ => middle,
        };
        shapes::mapped(&grid, |[x, y, _]| [x - 0.1, y - 0.1, height(x - 0.1)])
    }

    fn mixed(states: [&crate::mesh::TriMesh; 2]) -> Option<(Vec<Vec<[f64; 3]>>, Certificate)> {
        let (body, garment) = (body(), RestGarment::new(states[0]));
        let positions = states.map(|state| vec![state.positions().to_vec()]);
        let certificates = [0, 1]
            .map(|i| certify(&body, &[Layer { garment: &garment, positions: &positions[i][0] }]).unwrap());
        let layers = [Layer { garment: &garment, positions: &positions[0][0] }];
        let found =
            best_places(&layers, (&positions[0], &certificates[0]), (&positions[1], &certificates[1]))?;
        let certificate = certify(&body, &[Layer { garment: &garment, positions: &found[0] }]).unwrap();
        Some((found, certificate))
    }

    #[test]
    fn each_place_comes_from_the_state_that_mended_it() {
        let (left, right) = (sheet(0.11, 0.09, 0.1), sheet(0.09, 0.12, 0.1));
        for states in [[&left, &right], [&right, &left]] {
            let (found, certificate) = mixed(states).unwrap();
            assert_eq!(certificate.pairs(), 0);
            assert!(found[0] == sheet(0.11, 0.12, 0.1).positions());
        }
    }

    #[test]
    fn one_place_is_taken_whole() {
        // The middle differs as well: the sheet is one place.
        assert!(mixed([&sheet(0.11, 0.09, 0.1), &sheet(0.09, 0.12, 0.101)]).is_none());
        // Nothing is better in the other state.
        assert!(mixed([&sheet(0.11, 0.12, 0.1), &sheet(0.09, 0.09, 0.1)]).is_none());
        // All that differs is.
        assert!(mixed([&sheet(0.11, 0.09, 0.1), &sheet(0.11, 0.12, 0.1)]).is_none());
    }

    #[test]
    fn a_crossing_links_what_it_crosses() {
        // Two sheets that differ and cross each other in one of the states.
        let low = shapes::grid(0.2, 0.2, 4, 4);
        let garments = [RestGarment::new(&low), RestGarment::new(&low)];
        let lifted = |z: f64| shapes::mapped(&low, |p| add(p, [0.003, 0.002, z])).positions().to_vec();
        let (inner, outer) = ([lifted(0.0), lifted(0.01)], [lifted(0.02), lifted(0.03)]);
        let layers =
            [0, 1].map(|g| Layer { garment: &garments[g], positions: [&inner, &outer][g][0].as_slice() });
        let outfit = Outfit::new(&layers);
        let [one, other] = [0, 1].map(|i| [inner[i].clone(), outer[i].clone()].concat());
        let first_outer = outfit.faces_of_garment(1).start;
        let crossing = [Crossing::between((first_outer + 5, 5))];
        let take = |crossings: &[Crossing]| {
            let states = (State { positions: &one, crossings }, State { positions: &other, crossings: &[] });
            by_place(&outfit, &states.0, &states.1, |one, other| other < one)
        };
        assert!(take(&crossing).iter().all(|taken| *taken), "both sheets are one place");
        assert!(
            take(&[Crossing::with_body(3)])
                .iter()
                .enumerate()
                .all(|(v, taken)| *taken == (v < low.positions().len()))
        );
        assert!(!take(&[]).contains(&true));
    }
}
