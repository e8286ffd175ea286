//! The garments of one outfit, packed into one set of tensors.

use std::ops::Range;

use burn::tensor::{Device, Tensor};

use super::{GarmentTensors, matrix};
use crate::error::{ModelError, check_array};
use crate::packing::Packing;

/// Which garments press on which: one row per ordered pair.
#[derive(Clone, Debug)]
pub(crate) struct ForceEdges {
    /// One-hot receiver i of every edge `[E,M]`.
    pub receiver: Tensor<2>,
    /// One-hot sender j of every edge `[E,M]`.
    pub sender: Tensor<2>,
    /// Adds up edges whose sender lies below the receiver, j < i `[M,E]`.
    pub from_below: Tensor<2>,
    /// Adds up edges whose sender lies above the receiver, j > i `[M,E]`.
    pub from_above: Tensor<2>,
    /// One for every vertex of a garment with an edge, zero elsewhere `[ΣV,1]`; absent if every garment has one.
    pub touched: Option<Tensor<2>>,
}

/// M garments, inner to outer, packed along the vertices (ΣV of them).
#[derive(Clone, Debug)]
pub struct OutfitTensors {
    /// Rest positions `[ΣV,3]` (m): the coordinates the networks see.
    pub rest: Tensor<2>,
    /// Initial skin weights `[ΣV,J]`.
    pub skin_weights: Tensor<2>,
    /// Active joints of each garment, 0 or 1 `[M,J]`.
    pub joint_mask: Tensor<2>,
    /// Thickness of the garments below each vertex `[ΣV,1]` (cm, so that the numbers are about one); absent where nothing is.
    pub thickness_below: Option<Tensor<2>>,
    pub(crate) packing: Packing,
    pub(crate) edges: Option<ForceEdges>,
}

impl OutfitTensors {
    /// Packs garments, inner to outer.
    ///
    /// `contacts` lists the unordered pairs (a, b) of garments that can touch; repeated pairs count once.
    ///
    /// # Errors
    /// No garment at all, garments with different numbers of joints, or a pair that names a garment that is not there
    /// or twice the same.
    pub fn new(garments: &[&GarmentTensors], contacts: &[(usize, usize)]) -> Result<Self, ModelError> {
        let Some(first) = garments.first() else {
            let reason = "an outfit needs at least one garment".into();
            return Err(ModelError::Outfit { garment: 0, reason });
        };
        for (garment, tensors) in garments.iter().enumerate() {
            if tensors.joint_count() != first.joint_count() {
                let reason =
                    format!("{} joints, the innermost has {}", tensors.joint_count(), first.joint_count());
                return Err(ModelError::Outfit { garment, reason });
            }
        }
        let count = garments.len();
        if let Some(&(a, b)) = contacts.iter().find(|(a, b)| a == b || *a.max(b) >= count) {
            let reason = format!("contact ({a}, {b}) needs two different garments below {count}");
            return Err(ModelError::Outfit { garment: a.max(b), reason });
        }
        let mut pairs: Vec<_> = contacts.iter().map(|&(a, b)| (a.min(b), a.max(b))).collect();
        pairs.sort_unstable();
        pairs.dedup();

        let packing = Packing::new(garments.iter().map(|garment| garment.vertex_count()));
        let edges = ForceEdges::new(&pairs, &packing, &first.rest.device());
        let stack = |field: fn(&GarmentTensors) -> &Tensor<2>| {
            stack_rows(garments.iter().map(|garment| field(garment).clone()).collect())
        };
        Ok(Self {
            rest: stack(|garment| &garment.rest),
            skin_weights: stack(|garment| &garment.skin_weights),
            joint_mask: stack(|garment| &garment.joint_mask),
            thickness_below: None,
            packing,
            edges,
        })
    }

    /// The same with the thickness of the garments below each vertex `[ΣV]` (m); empty where nothing is.
    ///
    /// # Errors
    /// Another number of vertices, or a number that is not finite.
    pub fn with_thickness_below(self, thickness: &[f32]) -> Result<Self, ModelError> {
        if thickness.is_empty() {
            return Ok(Self { thickness_below: None, ..self });
        }
        let rows = self.vertex_count();
        check_array("thickness below", thickness, rows, "[ΣV]")?;
        let centimetres = thickness.iter().map(|t| t * 100.0).collect();
        let tensor = matrix(centimetres, rows, 1, &self.rest.device());
        Ok(Self { thickness_below: Some(tensor), ..self })
    }

    /// Every pair (i, j), i < j, of `count` garments.
    pub fn all_pairs(count: usize) -> Vec<(usize, usize)> {
        (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b))).collect()
    }

    /// Number of vertices of all garments, ΣV.
    pub fn vertex_count(&self) -> usize {
        self.packing.rows()
    }

    /// Rows of each garment in the packed tensors.
    pub fn ranges(&self) -> Vec<Range<usize>> {
        self.packing.ranges().collect()
    }

    /// Where the rows of each garment lie in the packed tensors.
    pub fn packing(&self) -> &Packing {
        &self.packing
    }

    /// Edges between all garments, whatever the contacts; `None` for a single one.
    pub(crate) fn complete_edges(&self) -> Option<ForceEdges> {
        ForceEdges::new(&Self::all_pairs(self.packing.count()), &self.packing, &self.rest.device())
    }
}

impl ForceEdges {
    fn new(pairs: &[(usize, usize)], packing: &Packing, device: &Device) -> Option<Self> {
        if pairs.is_empty() {
            return None;
        }
        // (receiver, sender), both directions of every contact.
        let edges: Vec<(usize, usize)> = pairs.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
        let (garments, count) = (packing.count(), edges.len());
        let numbered = || edges.iter().copied().enumerate();
        let sums = |below: bool| {
            let from_side = numbered().filter(|(_, (i, j))| (j < i) == below);
            one_hot([garments, count], from_side.map(|(edge, (i, _))| (i, edge)), device)
        };
        let has_edge: Vec<bool> =
            (0..garments).map(|garment| edges.iter().any(|&(i, _)| i == garment)).collect();
        let touched = (!has_edge.iter().all(|&edge| edge)).then(|| {
            let mut rows = vec![0.0_f32; packing.rows()];
            for (range, _) in packing.ranges().zip(&has_edge).filter(|(_, edge)| **edge) {
                rows[range].fill(1.0);
            }
            matrix(rows, packing.rows(), 1, device)
        });
        Some(Self {
            receiver: one_hot([count, garments], numbered().map(|(edge, (i, _))| (edge, i)), device),
            sender: one_hot([count, garments], numbered().map(|(edge, (_, j))| (edge, j)), device),
            from_below: sums(true),
            from_above: sums(false),
            touched,
        })
    }
}

/// A matrix of zeros but for ones at the given (row, column).
fn one_hot(
    [rows, columns]: [usize; 2],
    ones: impl Iterator<Item = (usize, usize)>,
    device: &Device,
) -> Tensor<2> {
    let mut values = vec![0.0_f32; rows * columns];
    for (row, column) in ones {
        values[row * columns + column] = 1.0;
    }
    matrix(values, rows, columns, device)
}

/// Concatenates along the rows; a lone tensor is shared, not copied.
pub(crate) fn stack_rows(mut tensors: Vec<Tensor<2>>) -> Tensor<2> {
    match tensors.len() {
        1 => tensors.remove(0),
        _ => Tensor::cat(tensors, 0),
    }
}
