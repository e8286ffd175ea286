//! A garment file: the mesh, what it is, and how it lies on the body.

use super::checked::CheckedFile;
use super::placement::misplacement;
use super::targets::ManifestHints;
use crate::asset::{Body, Category, Garment};
use crate::fit::{PlacementCheck, contact_warnings, outfit_warning};
use crate::format::load_tri_mesh;
use crate::mesh::{MeshMeasures, gaps_to};
use clothcombo_physics::Topology;
use clothcombo_physics::contact::{self_triangle_pairs, triangle_pairs};
use clothcombo_physics::query::Surface;
use serde::Serialize;
use std::path::Path;

/// Measurements of a garment file.
#[derive(Clone, Debug, Serialize)]
pub struct GarmentCheck {
    /// The mesh and its defects.
    pub mesh: MeshMeasures,
    /// Category, of the manifest or guessed.
    pub category: Category,
    /// Whether the category is a guess.
    pub category_guessed: bool,
    /// Lowest and highest layer, of the manifest or guessed.
    pub layer: [u32; 2],
    /// Whether the layer is a guess.
    pub layer_guessed: bool,
    /// Whether its rim is held: by the manifest, or because it lies wholly below the collarbone.
    pub holding: bool,
    /// Least signed distance of a vertex to the body at rest (mm), negative inside.
    pub distance_min_mm: f64,
    /// Median distance (mm).
    pub distance_median_mm: f64,
    /// Vertices inside the body.
    pub inside: usize,
    /// Garment and body triangles that intersect (exact).
    pub body_triangle_pairs: usize,
    /// Triangles that intersect each other (exact).
    pub self_triangle_pairs: usize,
}

/// The layers a garment goes into, from its median distance to the body (m): what lies closer than 8 mm goes under everything,
/// what lies farther than 20 mm, or is open in front, over something.
pub fn layer_guess(median_distance: f64, category: Category) -> [u32; 2] {
    let lowest = match median_distance {
        d if d < 0.008 => 1,
        d if d < 0.02 => 2,
        _ => 3,
    };
    let lowest = if category == Category::OpenShirt { lowest.max(2) } else { lowest };
    [lowest, lowest + 1]
}

/// Measurements and warnings, or why the garment cannot be used.
pub(super) fn check(
    path: &Path,
    hints: &ManifestHints,
    body: &Body,
    surface: &Surface<f64>,
    placement: &PlacementCheck,
) -> Result<CheckedFile<GarmentCheck>, String> {
    let mesh = load_tri_mesh(path).map_err(|e| e.to_string())?;
    let area = mesh.area();
    if !(area > 0.0 && area.is_finite()) {
        let triangles = mesh.face_count();
        return Err(format!("{}: no area: all {triangles} triangles are collapsed", path.display()));
    }
    let topology = Topology::new(&mesh);
    let measures = MeshMeasures::new(&mesh, &topology);
    if let Some(triangle) = measures.defects.doubled_triangles.first() {
        return Err(format!(
            "{}: triangle {triangle} (from 0) has the vertices of an earlier one; hint: `clothcombo fit` leaves such \
             triangles out",
            path.display()
        ));
    }
    let mut gaps = gaps_to(mesh.positions(), surface);
    gaps.sort_by(f64::total_cmp);
    let median = gaps[gaps.len() / 2];
    let category = hints.category.unwrap_or_else(|| Category::guess(&mesh, body));
    let garment = GarmentCheck {
        mesh: measures,
        category,
        category_guessed: hints.category.is_none(),
        layer: hints.layer.unwrap_or_else(|| layer_guess(median, category)),
        layer_guessed: hints.layer.is_none(),
        holding: hints.holding.unwrap_or_else(|| Garment::needs_holding(&mesh, body)),
        distance_min_mm: 1e3 * gaps[0],
        distance_median_mm: 1e3 * median,
        inside: gaps.iter().filter(|g| **g < 0.0).count(),
        body_triangle_pairs: triangle_pairs(
            mesh.positions(),
            mesh.faces(),
            &surface.positions,
            &surface.faces,
        )
        .len(),
        self_triangle_pairs: self_triangle_pairs(mesh.positions(), mesh.faces()).len(),
    };
    let misplaced = misplacement(&mesh, body, placement, &gaps);
    let mut warnings = warnings(&garment);
    warnings.extend(outfit_warning(placement.worn_pieces(&mesh, body)));
    if let Some(given) = hints.category {
        warnings.extend(placement.contradiction(&mesh, body, given));
    }
    let unusable = misplaced.map(|reason| format!("{}: {reason}", path.display()));
    Ok(CheckedFile { measured: garment, warnings, unusable })
}

fn warnings(garment: &GarmentCheck) -> Vec<String> {
    let mut warnings: Vec<String> =
        garment.mesh.defects.counts().into_iter().map(|(n, name)| format!("{n} {name}")).collect();
    if garment.mesh.boundary_loops == 0 {
        warnings.push("closed: a garment has openings".into());
    }
    let GarmentCheck { inside, body_triangle_pairs, self_triangle_pairs, .. } = *garment;
    warnings.extend(contact_warnings(inside, body_triangle_pairs, self_triangle_pairs));
    warnings
}
