//! Sets that grow together (union–find).

/// The numbers 0…n−1 in disjoint sets, each with its lowest member as its root.
#[derive(Clone, Debug)]
pub struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// Every number in a set of its own.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// Makes the sets of `a` and `b` one.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }

    /// The lowest member of the set of `member`. Paths are halved, so that the next query is faster.
    pub fn root(&mut self, mut member: u32) -> u32 {
        while self.parent[member as usize] != member {
            self.parent[member as usize] = self.parent[self.parent[member as usize] as usize];
            member = self.parent[member as usize];
        }
        member
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;

    #[test]
    fn they_are_those_of_naming_everything_anew() {
        let mut random = SplitMix::new(7);
        let mut any = || ((0.5 + 0.5 * random.symmetric()) * 60.0) as u32 % 60;
        let (mut sets, mut named) = (DisjointSets::new(60), (0..60).collect::<Vec<u32>>());
        for _ in 0..45 {
            let (a, b) = (any(), any());
            sets.join(a, b);
            let (a, b) = (named[a as usize], named[b as usize]);
            named.iter_mut().filter(|n| **n == a.max(b)).for_each(|n| *n = a.min(b));
            assert!((0..60).all(|i| sets.root(i) == named[i as usize]));
        }
        assert!(named.iter().any(|n| *n != 0) && named.iter().filter(|n| **n == 0).count() > 1);
    }
}
