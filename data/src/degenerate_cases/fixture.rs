//! What degenerate cases are made of: a body, two garments that fit it, and a piece of cloth against its chest.

use super::scene::{CaseError, CaseGarment, CaseScene};
use crate::asset::{Binding, BindingSettings, Body, Category, Garment, Pose};
use crate::generate::{GarmentError, GarmentGenerator};
use clothcombo_physics::mesh::shapes;
use clothcombo_physics::{MeshError, TriMesh, vec3, vertex_normals};

/// How far the outer layer of most cases lies below the inner one (m).
const WRONG_SIDE: f64 = 1e-3;

/// How deep the piece of cloth cuts into the chest (m).
const CHEST_DEPTH: f64 = 0.01;

/// How strongly the piece of cloth is bent (1/m): 2 cm at its sides.
const CURVATURE: f64 = 2.0;

/// How far canonical positions are above those at rest, so that the holding energy has something to hold (m).
const RAISED: f64 = 5e-3;

/// An interior vertex of the piece of cloth, and the one beside it.
pub(super) const MIDDLE: usize = 24;
pub(super) const BESIDE_MIDDLE: usize = 25;

/// Vertices per generated garment, about.
const GARMENT_VERTICES: usize = 220;

/// Everything that the cases of one body share.
#[derive(Debug)]
pub(super) struct Fixture<'a> {
    pub body: &'a Body,
    /// Foremost point of the chest of the zero body (m).
    pub chest: [f64; 3],
    t_shirt: (Garment, Binding),
    trousers: (Garment, Binding),
}

impl<'a> Fixture<'a> {
    pub(super) fn new(body: &'a Body) -> Result<Self, GarmentError> {
        let generator = GarmentGenerator::new(body)?;
        let cut = |category| {
            let garment = generator.generate(category, 1, GARMENT_VERTICES)?;
            let binding = Binding::new(&garment, body, &BindingSettings::default());
            Ok::<_, GarmentError>((garment, binding))
        };
        let (t_shirt, trousers) = (cut(Category::TShirt)?, cut(Category::Trousers)?);
        Ok(Self { body, chest: chest(body), t_shirt, trousers })
    }

    /// A piece of irregular cloth, 20 cm wide, bent about the vertical, in front of the chest and with its middle inside.
    pub(super) fn sheet(&self) -> TriMesh {
        let [x, y, z] = self.chest;
        let flat = shapes::irregular_grid(0.2, 0.2, 6, 6, 0.25, 9);
        let bent = |u: f64| -CURVATURE * u * u;
        shapes::mapped(&flat, |[u, v, _]| [x + u - 0.1, y + v - 0.1, z - CHEST_DEPTH + bent(u - 0.1)])
    }

    /// The piece of cloth with vertex `v` at `p`.
    pub(super) fn sheet_with_vertex(&self, v: usize, p: [f64; 3]) -> Result<TriMesh, MeshError> {
        let sheet = self.sheet();
        let mut positions = sheet.positions().to_vec();
        positions[v] = p;
        sheet.with_positions(positions)
    }

    /// The piece of cloth with vertex `v` where `other` is.
    pub(super) fn sheet_with_joined_vertices(&self, v: usize, other: usize) -> Result<TriMesh, MeshError> {
        self.sheet_with_vertex(v, self.sheet().positions()[other])
    }

    /// `point` of a frame in which the piece of cloth is centred on the origin, as the body sees it.
    pub(super) fn before_chest(&self, point: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.chest;
        vec3::add(point, [x, y, z - CHEST_DEPTH])
    }

    /// The piece of cloth, moved by `f`.
    pub(super) fn draped(&self, f: impl Fn([f64; 3]) -> [f64; 3]) -> Result<CaseScene, CaseError> {
        let sheet = self.sheet();
        let posed = shapes::mapped(&sheet, f);
        self.two_layers(sheet, &posed)
    }

    /// The piece of cloth with another rest shape.
    pub(super) fn with_rest(&self, rest: TriMesh) -> Result<CaseScene, CaseError> {
        self.two_layers(rest, &self.sheet())
    }

    /// Two layers of the garment of rest shape `rest` at `posed` on the T-posed body, the outer one on the wrong side.
    pub(super) fn two_layers(&self, rest: TriMesh, posed: &TriMesh) -> Result<CaseScene, CaseError> {
        let inner = cloth("inner", rest, posed);
        let outer = below(&inner);
        self.scene(vec![inner, outer])
    }

    /// `garments` on the T-posed body.
    pub(super) fn scene(&self, garments: Vec<CaseGarment>) -> Result<CaseScene, CaseError> {
        Ok(CaseScene { body: self.body.zero_body(), garments }.rounded())
    }

    /// Trousers and T-shirt, each in two layers, on the body of shape `shape` in `pose`, as skinning leaves them.
    pub(super) fn dressed(&self, shape: &[f64], pose: &Pose) -> Result<CaseScene, CaseError> {
        let posed = self.body.posed(shape, pose)?;
        let body = TriMesh::new(posed.positions, self.body.faces.to_vec())?;
        let garments = [&self.trousers, &self.t_shirt].into_iter().flat_map(|(garment, binding)| {
            let inner = self.skinned(garment, binding, shape, &posed.bones);
            let outer = below(&inner);
            [inner, outer]
        });
        Ok(CaseScene { body, garments: garments.collect() }.rounded())
    }

    /// The T-shirt on the T-posed body.
    pub(super) fn t_shirt(&self) -> CaseGarment {
        let rest = self.t_shirt.0.rest.positions().to_vec();
        CaseGarment { garment: self.t_shirt.0.clone(), canonical: raised(&rest), posed: rest }
    }

    fn skinned(
        &self,
        garment: &Garment,
        binding: &Binding,
        shape: &[f64],
        bones: &[[[f64; 4]; 3]],
    ) -> CaseGarment {
        let mut canonical = garment.rest.positions().to_vec();
        for (p, moved) in canonical.iter_mut().zip(binding.shape_displacement(shape, self.body.shape_count)) {
            vec3::accumulate(p, moved);
        }
        let (posed, canonical) = (binding.skinned(&canonical, bones), raised(&canonical));
        // Held whatever its height: the holding energy is to be tested here as well.
        let garment = Garment { holding: true, ..garment.clone() };
        CaseGarment { garment, canonical, posed }
    }
}

/// A garment that is nothing but its mesh, at `posed` after skinning and a little higher before.
pub(super) fn cloth(name: &str, rest: TriMesh, posed: &TriMesh) -> CaseGarment {
    let posed = posed.positions().to_vec();
    let garment = Garment { name: name.to_string(), holding: true, ..Garment::new(Category::Top, rest) };
    CaseGarment { garment, canonical: raised(&posed), posed }
}

fn raised(positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
    positions.iter().map(|p| vec3::add(*p, [0.0, RAISED, 0.0])).collect()
}

/// The same garment a millimetre below itself, where it should not be.
fn below(inner: &CaseGarment) -> CaseGarment {
    let normals = vertex_normals(&inner.posed, inner.garment.rest.faces());
    let sunk = inner.posed.iter().zip(normals).map(|(p, n)| vec3::add_scaled(*p, -WRONG_SIDE, n));
    let garment = Garment { name: format!("{}, outer", inner.garment.name), ..inner.garment.clone() };
    CaseGarment { garment, canonical: inner.canonical.clone(), posed: sunk.collect() }
}

/// The foremost vertex around the breastbone.
fn chest(body: &Body) -> [f64; 3] {
    let height = body.joint_place("spine3").map_or(0.0, |p| p[1]);
    let central = |p: &&[f64; 3]| p[0].abs() < 0.1 && (p[1] - height).abs() < 0.05;
    let foremost = |points: &mut dyn Iterator<Item = &[f64; 3]>| -> Option<[f64; 3]> {
        points.max_by(|a, b| a[2].total_cmp(&b[2])).copied()
    };
    let found = foremost(&mut body.template.iter().filter(central));
    found.or_else(|| foremost(&mut body.template.iter())).unwrap_or_default()
}
