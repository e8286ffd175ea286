//! The joints a wardrobe needs: those that carry any garment. Hands, feet and face never enter the networks.

use clothcombo_data::asset::Body;

/// Joints with weight on at least one garment, in body order.
#[derive(Clone, Debug, PartialEq)]
pub struct ActiveJoints {
    /// Indices into the body's joints, ascending.
    pub indices: Vec<usize>,
    body_joints: usize,
}

/// Below this weight on every vertex of every garment a joint is dropped; what remains is renormalised.
const NEGLIGIBLE: f32 = 1e-3;

impl ActiveJoints {
    /// Collects the joints in use from the largest weight of every joint on each garment
    /// ([`Binding::largest_weights`](clothcombo_data::asset::Binding::largest_weights)).
    pub fn new<'a>(body: &Body, garments: impl IntoIterator<Item = &'a [f32]>) -> Self {
        let joints = body.joint_names.len();
        let mut largest = vec![0f32; joints];
        for garment in garments {
            largest.iter_mut().zip(garment).for_each(|(l, w)| *l = l.max(*w));
        }
        let indices = (0..joints).filter(|&j| largest[j] > NEGLIGIBLE).collect();
        Self { indices, body_joints: joints }
    }

    /// The joints of these names, in this order: those that trained networks see.
    ///
    /// # Errors
    /// The names that `body` has no joint of.
    pub fn named(body: &Body, names: &[String]) -> Result<Self, Vec<String>> {
        let find =
            |name: &String| body.joint_names.iter().position(|n| n == name).ok_or_else(|| name.clone());
        let (found, missing): (Vec<_>, Vec<_>) = names.iter().map(find).partition(Result::is_ok);
        if !missing.is_empty() {
            return Err(missing.into_iter().filter_map(Result::err).collect());
        }
        let indices = found.into_iter().filter_map(Result::ok).collect();
        Ok(Self { indices, body_joints: body.joint_names.len() })
    }

    /// Number of active joints.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether no joint is active.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// Columns of the active joints of dense `[V, all joints]` weights, rows renormalised to sum 1.
    pub fn restrict(&self, weights: &[f32]) -> Vec<f32> {
        let mut out = Vec::with_capacity(weights.len() / self.body_joints * self.len());
        for row in weights.chunks_exact(self.body_joints) {
            let sum: f32 = self.indices.iter().map(|&j| row[j]).sum();
            // A vertex bound to dropped joints only (it carries no visible weight elsewhere) follows the first one.
            match sum > 0.0 {
                true => out.extend(self.indices.iter().map(|&j| row[j] / sum)),
                false => out.extend((0..self.len()).map(|k| if k == 0 { 1.0 } else { 0.0 })),
            }
        }
        out
    }
}
