//! Bounding boxes of moving triangles in a tree of eight children a node, refitted in O(F) and never rebuilt.
//!
//! Boxes are `f32`, rounded outward, eight of them side by side: one comparison of a box with a node is six comparisons
//! of eight lanes.

use crate::vec3;
use rayon::prelude::*;

/// Children of a node, and faces of a leaf.
const CHILDREN: usize = 8;
/// A lane without a face.
const NO_FACE: u32 = u32::MAX;

/// An axis-aligned box (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
}

impl Bounds {
    const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// The box around `points`.
    pub fn around(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let (low, high) = vec3::bounds(points);
        Self { low: low.map(below), high: high.map(above) }
    }

    /// This box, `margin` (m) wider on every side.
    fn widened(self, margin: f64) -> Self {
        Self {
            low: self.low.map(|x| below(f64::from(x) - margin)),
            high: self.high.map(|x| above(f64::from(x) + margin)),
        }
    }

    fn merged(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }
}

/// The largest `f32` that is not above `x`.
fn below(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) > x { rounded.next_down() } else { rounded }
}

/// The smallest `f32` that is not below `x`.
fn above(x: f64) -> f32 {
    -below(-x)
}

/// Eight boxes side by side.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct BoxNode {
    low: [[f32; CHILDREN]; 3],
    high: [[f32; CHILDREN]; 3],
}

impl BoxNode {
    const EMPTY: Self =
        Self { low: [[f32::INFINITY; CHILDREN]; 3], high: [[f32::NEG_INFINITY; CHILDREN]; 3] };

    fn set(&mut self, lane: usize, bounds: Bounds) {
        for k in 0..3 {
            self.low[k][lane] = bounds.low[k];
            self.high[k][lane] = bounds.high[k];
        }
    }

    fn get(&self, lane: usize) -> Bounds {
        Bounds { low: self.low.map(|lanes| lanes[lane]), high: self.high.map(|lanes| lanes[lane]) }
    }

    fn union(&self) -> Bounds {
        (0..CHILDREN).fold(Bounds::EMPTY, |all, lane| all.merged(self.get(lane)))
    }

    /// Which lanes meet `bounds`: bit `i` for lane `i`.
    #[inline(always)]
    fn meeting(&self, bounds: &Bounds) -> u32 {
        let mut meets = [true; CHILDREN];
        for k in 0..3 {
            let (low, high) = (bounds.low[k], bounds.high[k]);
            for lane in 0..CHILDREN {
                meets[lane] &= (self.low[k][lane] <= high) & (low <= self.high[k][lane]);
            }
        }
        (0..CHILDREN).fold(0, |bits, lane| bits | u32::from(meets[lane]) << lane)
    }
}

/// Boxes of some faces of a mesh.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxTree {
    /// Faces in the order of the lanes; [`NO_FACE`] where there is none.
    order: Vec<u32>,
    /// Nodes from the leaves up: lane `i` of node `n` of a level bounds node `8n + i` of the level below.
    levels: Vec<Vec<BoxNode>>,
}

impl BoxTree {
    /// A tree of faces, given with where they are (m); its boxes are empty until it is fitted.
    pub fn new(mut faces: Vec<([f64; 3], u32)>) -> Self {
        let leaves = faces.len().div_ceil(CHILDREN);
        let mut block = CHILDREN;
        while block * CHILDREN < faces.len() {
            block *= CHILDREN;
        }
        sort(&mut faces, block);
        let mut faces: Vec<u32> = faces.into_iter().map(|(_, f)| f).collect();
        faces.resize(leaves * CHILDREN, NO_FACE);
        let mut levels = vec![vec![BoxNode::EMPTY; leaves]];
        while levels[levels.len() - 1].len() > 1 {
            let above = levels[levels.len() - 1].len().div_ceil(CHILDREN);
            levels.push(vec![BoxNode::EMPTY; above]);
        }
        Self { order: faces, levels }
    }

    /// Gives every face that `is_moved` the box that `bounds` says.
    pub fn fit(&mut self, bounds: impl Fn(u32) -> Bounds, is_moved: impl Fn(u32) -> bool) {
        for (leaf, faces) in self.levels[0].iter_mut().zip(self.order.chunks(CHILDREN)) {
            for (lane, &face) in faces.iter().enumerate().filter(|(_, f)| **f != NO_FACE && is_moved(**f)) {
                leaf.set(lane, bounds(face));
            }
        }
        for level in 1..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(level);
            for (node, children) in above[0].iter_mut().zip(below[level - 1].chunks(CHILDREN)) {
                for (lane, child) in children.iter().enumerate() {
                    node.set(lane, child.union());
                }
            }
        }
    }

    /// Calls `found` for every leaf that meets `bounds`.
    fn leaves_meeting(&self, bounds: &Bounds, stack: &mut Vec<(usize, usize)>, mut found: impl FnMut(usize)) {
        let top = self.levels.len() - 1;
        stack.clear();
        if !self.levels[0].is_empty() {
            stack.push((top, 0));
        }
        while let Some((level, node)) = stack.pop() {
            let mut bits = self.levels[level][node].meeting(bounds);
            if level == 0 {
                if bits != 0 {
                    found(node);
                }
                continue;
            }
            while bits != 0 {
                stack.push((level - 1, node * CHILDREN + bits.trailing_zeros() as usize));
                bits &= bits - 1;
            }
        }
    }

    /// Calls `found` for every face whose box meets `bounds`.
    pub fn faces_meeting(
        &self,
        bounds: &Bounds,
        stack: &mut Vec<(usize, usize)>,
        mut found: impl FnMut(u32),
    ) {
        self.leaves_meeting(bounds, stack, |leaf| {
            let mut bits = self.levels[0][leaf].meeting(bounds);
            while bits != 0 {
                found(self.order[leaf * CHILDREN + bits.trailing_zeros() as usize]);
                bits &= bits - 1;
            }
        });
    }

    fn leaf_faces(&self, leaf: usize) -> &[u32] {
        &self.order[leaf * CHILDREN..(leaf + 1) * CHILDREN]
    }

    /// Which leaves have a face that `is_moved`.
    fn moved_leaves(&self, is_moved: impl Fn(u32) -> bool) -> Vec<bool> {
        self.order.chunks(CHILDREN).map(|faces| faces.iter().any(|&f| f != NO_FACE && is_moved(f))).collect()
    }

    /// Pairs of faces of this tree whose boxes are no farther apart than `reach` (m) along any axis, of which one
    /// `is_moved`; each once, the smaller number first.
    pub fn pairs(&self, reach: f64, is_moved: impl Fn(u32) -> bool + Copy + Sync) -> Vec<(u32, u32)> {
        let moved = self.moved_leaves(is_moved);
        self.pairs_of((&moved, reach), self, is_moved, |leaf, other| other >= leaf || !moved[other])
            .into_iter()
            .map(|(f, g)| (f.min(g), f.max(g)))
            .collect()
    }

    /// Pairs (face of this tree that `is_moved`, face of `other`) whose boxes are no farther apart than `reach` (m)
    /// along any axis.
    pub fn pairs_with(
        &self,
        other: &Self,
        reach: f64,
        is_moved: impl Fn(u32) -> bool + Copy + Sync,
    ) -> Vec<(u32, u32)> {
        self.pairs_of((&self.moved_leaves(is_moved), reach), other, is_moved, |_, _| true)
    }

    fn pairs_of(
        &self,
        (moved, reach): (&[bool], f64),
        other: &Self,
        is_moved: impl Fn(u32) -> bool + Copy + Sync,
        is_asked: impl Fn(usize, usize) -> bool + Sync,
    ) -> Vec<(u32, u32)> {
        let is_same = std::ptr::eq(self, other);
        let leaves: Vec<usize> = (0..moved.len()).filter(|&leaf| moved[leaf]).collect();
        let of_chunk = |chunk: &[usize]| {
            let (mut pairs, mut stack) = (Vec::new(), Vec::new());
            for &leaf in chunk {
                let node = &self.levels[0][leaf];
                other.leaves_meeting(&node.union().widened(reach), &mut stack, |near| {
                    if !is_asked(leaf, near) {
                        return;
                    }
                    for (lane, &f) in self.leaf_faces(leaf).iter().enumerate().filter(|(_, f)| **f != NO_FACE)
                    {
                        let mut bits = other.levels[0][near].meeting(&node.get(lane).widened(reach));
                        if is_same && leaf == near {
                            // Each pair of a leaf once.
                            bits &= !0 << (lane + 1);
                        }
                        while bits != 0 {
                            let g = other.order[near * CHILDREN + bits.trailing_zeros() as usize];
                            bits &= bits - 1;
                            if is_moved(f) || is_same && is_moved(g) {
                                pairs.push((f, g));
                            }
                        }
                    }
                });
            }
            pairs
        };
        leaves.par_chunks(32).flat_map_iter(of_chunk).collect()
    }
}

/// Orders `faces` so that blocks of `block`, of an eighth of it and so on lie close together.
fn sort(faces: &mut [([f64; 3], u32)], mut block: usize) {
    while block >= faces.len() && block > 1 {
        block /= CHILDREN;
    }
    if faces.len() <= CHILDREN || block < CHILDREN {
        return;
    }
    let (low, high) = vec3::bounds(faces.iter().map(|(c, _)| *c));
    let extent = vec3::sub(high, low);
    let axis = (0..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best });
    let middle = (faces.len().div_ceil(block) / 2).max(1) * block;
    faces.select_nth_unstable_by(middle, |(a, f), (b, g)| a[axis].total_cmp(&b[axis]).then(f.cmp(g)));
    let (left, right) = faces.split_at_mut(middle);
    sort(left, block);
    sort(right, block);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;

    fn boxes(count: usize, seed: u64) -> Vec<Bounds> {
        let mut random = SplitMix::new(seed);
        let mut point = || std::array::from_fn::<f64, 3, _>(|_| random.symmetric());
        (0..count)
            .map(|_| {
                let p = point();
                Bounds::around([p, vec3::add_scaled(p, 0.1, point())]).widened(0.01)
            })
            .collect()
    }

    fn tree(boxes: &[Bounds]) -> BoxTree {
        let mut tree = BoxTree::new((0..).zip(boxes).map(|(f, b)| (b.low.map(f64::from), f)).collect());
        tree.fit(|f| boxes[f as usize], |_| true);
        tree
    }

    fn meet(a: &Bounds, b: &Bounds) -> bool {
        (0..3).all(|k| a.low[k] <= b.high[k] && b.low[k] <= a.high[k])
    }

    #[test]
    fn pairs_are_those_of_all_boxes_and_each_comes_once() {
        for count in [0, 1, 7, 8, 9, 65, 700] {
            let (ours, others) = (boxes(count, 1), boxes(3 * count / 2, 2));
            let (own, other) = (tree(&ours), tree(&others));
            for share in [1, 3, 40] {
                let is_moved = |f: u32| f.is_multiple_of(share);
                let mut found = own.pairs(0.0, is_moved);
                found.sort_unstable();
                let number = |n: usize| 0..n as u32;
                let pairs = number(count).flat_map(|f| (f + 1..count as u32).map(move |g| (f, g)));
                let expected: Vec<(u32, u32)> = pairs
                    .filter(|&(f, g)| is_moved(f) || is_moved(g))
                    .filter(|&(f, g)| meet(&ours[f as usize], &ours[g as usize]))
                    .collect();
                assert_eq!(found, expected);
                let mut found = own.pairs_with(&other, 0.0, is_moved);
                found.sort_unstable();
                let pairs = number(count).flat_map(|f| number(others.len()).map(move |g| (f, g)));
                let expected: Vec<(u32, u32)> = pairs
                    .filter(|&(f, g)| is_moved(f) && meet(&ours[f as usize], &others[g as usize]))
                    .collect();
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn boxes_are_rounded_outward() {
        let mut random = SplitMix::new(3);
        for _ in 0..1000 {
            let p = std::array::from_fn::<f64, 3, _>(|_| random.symmetric());
            let found = Bounds::around([p]);
            assert!((0..3).all(|k| f64::from(found.low[k]) <= p[k] && p[k] <= f64::from(found.high[k])));
        }
        assert_eq!(below(1.0), 1.0);
        assert!(below(1.0 - 1e-12) < 1.0 && above(1.0 + 1e-12) > 1.0);
    }
}
