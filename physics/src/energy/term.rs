//! The list of energies, and a map with one entry per energy.

use std::ops::{Index, IndexMut};

/// One of the eight energies. Its name is its file name and its key in a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// Saint Venant–Kirchhoff membrane energy (J).
    Strain,
    /// Hinge energy (J).
    Bending,
    /// Potential energy in the field of the Earth (J).
    Gravity,
    /// Cubic penalty of garment vertices closer to the body than a margin (m³).
    BodyCollision,
    /// Logarithmic repulsion between vertices of one garment (1).
    Repulsion,
    /// Squared vertical displacement of the garment's upper edge, before skinning (m²).
    Holding,
    /// Cubic penalty of outer vertices below the inner garment (m³).
    LayerCollision,
    /// Cubic penalty of an inner garment farther from the body than the outer one (m³).
    LayerDistance,
}

impl Term {
    /// How many there are.
    pub const COUNT: usize = 8;

    /// All of them, in the order in which they are summed and reported.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Strain,
        Self::Bending,
        Self::Gravity,
        Self::BodyCollision,
        Self::Repulsion,
        Self::Holding,
        Self::LayerCollision,
        Self::LayerDistance,
    ];

    /// The name in configurations and reports: the file name of the term.
    pub fn name(self) -> &'static str {
        match self {
            Self::Strain => "strain",
            Self::Bending => "bending",
            Self::Gravity => "gravity",
            Self::BodyCollision => "body_collision",
            Self::Repulsion => "repulsion",
            Self::Holding => "holding",
            Self::LayerCollision => "layer_collision",
            Self::LayerDistance => "layer_distance",
        }
    }

    /// Whether the term is about a pair of garments; the others are about one.
    pub fn is_layer_term(self) -> bool {
        matches!(self, Self::LayerCollision | Self::LayerDistance)
    }
}

impl std::fmt::Display for Term {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// One value per [`Term`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TermMap<V>([V; Term::COUNT]);

impl<V> TermMap<V> {
    /// The map with `value(term)` for every term.
    pub fn from_fn(mut value: impl FnMut(Term) -> V) -> Self {
        Self(std::array::from_fn(|i| value(Term::ALL[i])))
    }

    /// Terms and values in the order of [`Term::ALL`].
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (Term, &V)> {
        Term::ALL.into_iter().zip(&self.0)
    }

    /// The map of `f(term, value)`.
    pub fn map<W>(&self, mut f: impl FnMut(Term, &V) -> W) -> TermMap<W> {
        TermMap::from_fn(|term| f(term, &self[term]))
    }
}

impl<V: Copy> TermMap<V> {
    /// The same value for every term.
    pub fn filled(value: V) -> Self {
        Self([value; Term::COUNT])
    }
}

impl<V> Index<Term> for TermMap<V> {
    type Output = V;

    fn index(&self, term: Term) -> &V {
        &self.0[term as usize]
    }
}

impl<V> IndexMut<Term> for TermMap<V> {
    fn index_mut(&mut self, term: Term) -> &mut V {
        &mut self.0[term as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_the_list_is_in_order() {
        for (i, term) in Term::ALL.into_iter().enumerate() {
            assert_eq!(term as usize, i, "TermMap relies on the order of the list");
            assert_eq!(Term::ALL.iter().filter(|other| other.name() == term.name()).count(), 1);
        }
    }

    #[test]
    fn a_map_keeps_one_value_per_term() {
        let mut map = TermMap::filled(0.0);
        map[Term::Holding] = 2.0;
        let set: Vec<Term> = map.iter().filter(|(_, v)| **v != 0.0).map(|(t, _)| t).collect();
        assert_eq!(set, [Term::Holding]);
        assert_eq!(map.map(|_, v| v * 3.0)[Term::Holding], 6.0);
    }
}
