//! Cloth on a source body, and what it takes from the body next to it.

use crate::asset::{Binding, BindingSettings, Body, BodyParts, Category, Garment};
use clothcombo_physics::TriMesh;

/// Cloth on the body that it was made on, in its coordinates (m).
pub(in crate::fit) struct SourceCloth<'a> {
    pub positions: &'a [[f64; 3]],
    pub faces: &'a [[u32; 3]],
    pub category: Option<Category>,
}

impl SourceCloth<'_> {
    /// Binds the cloth at `positions` to `on`; `target` guesses the category where none is known.
    pub fn bound(&self, positions: Vec<[f64; 3]>, on: &Body, target: &Body) -> Result<Binding, String> {
        let mesh = TriMesh::new(positions, self.faces.to_vec()).map_err(|e| e.to_string())?;
        let category = self.category.unwrap_or_else(|| Category::guess(&mesh, target));
        Ok(Binding::new(&Garment::new(category, mesh), on, &BindingSettings::default()))
    }
}

/// `body` with these vertices, joints and one shape component, whose bindings cost no more than that. Without a
/// direction it has none.
pub(super) fn one_shape_body(
    body: &Body,
    template: Vec<[f64; 3]>,
    joints: Vec<[f64; 3]>,
    direction: Option<Vec<f32>>,
) -> Result<Body, String> {
    let (shape_count, shape_directions) = direction.map_or((0, Vec::new()), |d| (1, d));
    Body::new(BodyParts {
        name: body.name.clone(),
        faces: body.faces.clone(),
        template,
        shape_directions,
        shape_count,
        joint_shape_directions: vec![0.0; 3 * shape_count * joints.len()],
        joint_template: joints,
        pose_directions: None,
        skin_weights: body.skin_weights.clone(),
        parents: body.parents.clone(),
        joint_names: body.joint_names.clone(),
    })
    .map_err(|e| e.to_string())
}
