//! From the pose and shape a sample's garments were made in to the zero body in T-pose.

use crate::asset::body::unskin;
use crate::asset::rotation::{Matrix3, apply, matrix_from_axis_angle, product};
use crate::asset::{Binding, BindingSettings, Body, Category, Garment, Pose};
use crate::import::WorldUp;
use clothcombo_physics::TriMesh;

/// How far the legs are apart in the rest pose of CLOTH3D: θ₁ = (0, 0, 0.15), θ₂ = (0, 0, −0.15) (rad).
const LEG_SPREAD: f64 = 0.15;

/// Takes garments from one sample's rest body to the zero body of the data set.
pub struct Unposing {
    /// The sample's body in its rest pose; its one "shape direction" is what every vertex moves from the target zero body.
    rest: Body,
    bones: Vec<[[f64; 4]; 3]>,
}

impl Unposing {
    /// `body` is the sample's (of its gender), `shape` its shape; `target` the body the garments are for, with the same
    /// vertices.
    ///
    /// # Errors
    /// If `body` lacks joints or shape components, or its vertices are not those of `target`.
    pub fn new(body: &Body, shape: &[f64], target: &Body) -> Result<Self, String> {
        if body.vertex_count() != target.vertex_count() || body.faces != target.faces {
            return Err(format!("body '{}' is not the same mesh as body '{}'", body.name, target.name));
        }
        let mut pose = Pose::t_pose(3);
        pose.rotations[1] = [0.0, 0.0, LEG_SPREAD];
        pose.rotations[2] = [0.0, 0.0, -LEG_SPREAD];
        let posed = body.posed(shape, &pose).map_err(|e| e.to_string())?;
        let mut displacement = Vec::with_capacity(3 * body.vertex_count());
        for (v, p) in posed.positions.iter().enumerate() {
            let bones = body.skin_weights.of_vertex(v).map(|(j, w)| (&posed.bones[j], f64::from(w)));
            let unposed = unskin(*p, bones)
                .ok_or_else(|| format!("vertex {v} of body '{}' cannot be unposed", body.name))?;
            displacement.extend((0..3).map(|a| (unposed[a] - target.template[v][a]) as f32));
        }
        let mut rest = body.clone();
        rest.template = posed.positions;
        rest.shape_directions = displacement;
        rest.shape_count = 1;
        rest.pose_directions = None;
        Ok(Self { rest, bones: posed.bones })
    }

    /// A garment at rest on the sample's body (m, y up), as it lies on the zero body in T-pose. Each vertex goes with the
    /// body vertex nearest to it, smoothed over the garment as `settings` say.
    ///
    /// # Errors
    /// If a vertex cannot be unposed.
    pub fn apply(
        &self,
        mesh: &TriMesh,
        category: Category,
        settings: &BindingSettings,
    ) -> Result<Vec<[f64; 3]>, String> {
        let garment = Garment::new(category, mesh.clone());
        let binding = Binding::new(&garment, &self.rest, settings);
        // Without shape transfer it stays on the sample's body.
        let moved = binding.shape_displacement(&[1.0], 1);
        let moved = |v: usize| moved.get(v).copied().unwrap_or_default();
        let joints = self.bones.len();
        (mesh.positions().iter().enumerate())
            .map(|(v, p)| {
                let weights = &binding.skin_weights[v * joints..(v + 1) * joints];
                let bones =
                    self.bones.iter().zip(weights.iter().map(|w| f64::from(*w))).filter(|(_, w)| *w > 0.0);
                let unposed = unskin(*p, bones).ok_or_else(|| format!("vertex {v} cannot be unposed"))?;
                let moved = moved(v);
                Ok(std::array::from_fn(|a| unposed[a] - moved[a]))
            })
            .collect()
    }
}

/// A rest garment's points from the file's frame (z up, turned by `zrot`) to y up, facing +z.
pub fn upright(positions: &mut [[f64; 3]], zrot: f64) {
    let turn: Matrix3 = product(&WorldUp::Z.to_y_up(), &matrix_from_axis_angle([0.0, 0.0, -zrot]));
    positions.iter_mut().for_each(|p| *p = apply(&turn, *p));
}
