//! The joints a dataset needs: those that carry any garment. Hands, feet and face never enter the networks.

use clothcombo_data::asset::Body;

/// Joints with weight on at least one garment, in body order.
#[derive(Clone, Debug, PartialEq)]
pub struct ActiveJoints {
    /// Indices into the body's joints, ascending.
    pub indices: Vec<usize>,
    /// Of every active joint the nearest active joint above it, as a position in `indices`.
    pub parents: Vec<Option<usize>>,
    /// Of every joint of the body: the position in `indices` of the joint that takes its weight.
    taken_by: Vec<usize>,
}

/// Below this weight on every vertex of every garment a joint is dropped; its nearest active ancestor takes the weight.
const NEGLIGIBLE_WEIGHT: f32 = 1e-3;

impl ActiveJoints {
    /// Collects the joints in use from the largest weight of every joint on each garment
    /// ([`Binding::largest_weights`](clothcombo_data::asset::Binding::largest_weights)).
    pub fn new<'a>(body: &Body, garments: impl IntoIterator<Item = &'a [f32]>) -> Self {
        let joints = body.joint_names.len();
        let mut largest = vec![0f32; joints];
        for garment in garments {
            largest.iter_mut().zip(garment).for_each(|(l, w)| *l = l.max(*w));
        }
        Self::of(body, (0..joints).filter(|&j| largest[j] > NEGLIGIBLE_WEIGHT).collect())
    }

    /// The joints of these names, in this order: those that trained networks see.
    ///
    /// # Errors
    /// The names that `body` has no joint of.
    pub fn named(body: &Body, names: &[String]) -> Result<Self, Vec<String>> {
        let find = |name: &String| body.joint_names.iter().position(|n| n == name);
        let missing: Vec<String> = names.iter().filter(|name| find(name).is_none()).cloned().collect();
        match missing.is_empty() {
            true => Ok(Self::of(body, names.iter().filter_map(find).collect())),
            false => Err(missing),
        }
    }

    fn of(body: &Body, indices: Vec<usize>) -> Self {
        let taken_by = heirs(&body.parents, &indices);
        let position = |joint: usize| indices.iter().position(|&j| j == joint);
        let above = |&joint: &usize| {
            std::iter::successors(body.parents[joint], |&j| body.parents[j]).find_map(position)
        };
        let parents = indices.iter().map(above).collect();
        Self { indices, parents, taken_by }
    }

    /// Number of active joints.
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Whether no joint is active.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// Weights of the active joints of dense `[V, all joints]` weights, rows summing to 1.
    ///
    /// The nearest active ancestor takes the weight of a dropped joint: a sleeve bound to the hand follows the forearm. Without
    /// an active ancestor, the nearest active joint of the smallest subtree that contains the dropped joint and an active one.
    pub fn restrict(&self, weights: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; weights.len() / self.taken_by.len() * self.len()];
        for (row, out) in
            weights.chunks_exact(self.taken_by.len()).zip(out.chunks_exact_mut(self.len().max(1)))
        {
            for (&weight, &heir) in row.iter().zip(&self.taken_by) {
                out[heir] += weight;
            }
            let sum: f32 = out.iter().sum();
            out.iter_mut().for_each(|weight| *weight /= sum);
        }
        out
    }
}

/// Of every joint the position in `active` of the joint that takes its weight; see [`ActiveJoints::restrict`].
fn heirs(parents: &[Option<usize>], active: &[usize]) -> Vec<usize> {
    let position = |joint: usize| active.iter().position(|&j| j == joint);
    let ancestors = |joint: usize| std::iter::successors(Some(joint), |&j| parents[j]);
    // Length of the path from `ancestor` down to `joint`.
    let depth_below = |ancestor: usize, joint: usize| ancestors(joint).position(|j| j == ancestor);
    let heir = |joint: usize| {
        let nearest_below = |root: usize| {
            let below = active.iter().enumerate().filter_map(|(k, &j)| Some((depth_below(root, j)?, k)));
            below.min().map(|(_, k)| k)
        };
        let above = ancestors(joint).find_map(position);
        above.or_else(|| ancestors(joint).find_map(nearest_below)).unwrap_or(0)
    };
    (0..parents.len()).map(heir).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::generate::mannequin;

    fn active(names: &[&str]) -> ActiveJoints {
        let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
        ActiveJoints::named(&mannequin(), &names).unwrap()
    }

    /// A vertex with these weights; the weights of the active joints, by name.
    fn restricted(active: &ActiveJoints, weights: &[(&str, f32)]) -> Vec<(String, f32)> {
        let body = mannequin();
        let mut row = vec![0.0; body.joint_count()];
        for (name, weight) in weights {
            row[body.joint_names.iter().position(|n| n == name).unwrap()] = *weight;
        }
        let found = active.restrict(&row);
        let names = active.indices.iter().map(|&j| body.joint_names[j].clone());
        names.zip(found).filter(|(_, weight)| *weight != 0.0).collect()
    }

    #[test]
    fn a_sleeve_bound_to_the_hand_follows_the_forearm() {
        let active = active(&["pelvis", "spine3", "left_shoulder", "left_elbow"]);
        assert_eq!(restricted(&active, &[("left_wrist", 1.0)]), [("left_elbow".to_owned(), 1.0)]);
        let found = restricted(&active, &[("left_wrist", 0.25), ("left_elbow", 0.5), ("head", 0.25)]);
        assert_eq!(found, [("spine3".to_owned(), 0.25), ("left_elbow".to_owned(), 0.75)]);
    }

    #[test]
    fn without_an_active_ancestor_the_nearest_joint_below_takes_the_weight() {
        let active = active(&["left_knee", "left_shoulder", "left_elbow"]);
        for (dropped, heir) in [
            ("left_hip", "left_knee"),
            ("spine2", "left_shoulder"),
            ("left_collar", "left_shoulder"),
            // No active joint above or below: the smallest subtree with one is that of the pelvis, of the upper spine.
            ("right_ankle", "left_knee"),
            ("right_wrist", "left_shoulder"),
        ] {
            assert_eq!(restricted(&active, &[(dropped, 1.0)]), [(heir.to_owned(), 1.0)], "{dropped}");
        }
    }

    #[test]
    fn weights_of_active_joints_alone_stay_bit_for_bit() {
        let active = active(&["pelvis", "left_hip", "right_hip"]);
        let found = restricted(&active, &[("pelvis", 0.5), ("left_hip", 0.25), ("right_hip", 0.25)]);
        assert_eq!(found.iter().map(|(_, w)| *w).collect::<Vec<_>>(), [0.5, 0.25, 0.25]);
    }
}
