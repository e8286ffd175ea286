//! Exact intersections of garments and bodies against brute force over all pairs of triangles, decided twice: by the
//! library's own exact test and by separating axes in 128-bit integers, which share no formula with it.
//!
//! Positions are put on a grid of 2⁻²⁰ m (about a micrometre), where integers hold them exactly.

use clothcombo_data::asset::{Binding, BindingSettings, Body, BodyFileSettings, Category, Garment, Pose};
use clothcombo_data::folders::{load_garment_folder, load_motion_folder};
use clothcombo_data::generate::{GarmentGenerator, mannequin};
use clothcombo_physics::Surface;
use clothcombo_physics::contact::{
    CountedBody, LayerOrder, Report, ReportGarment, Selection, TriangleTree, all_layers,
    mesh_triangles_intersect, triangles_intersect,
};
use clothcombo_physics::mesh::TriMesh;
use clothcombo_physics::query::Distance;
use grid_oracle::GridPoint;
use rayon::prelude::*;
use std::path::Path;

#[path = "../../../physics/src/contact/tests/grid_oracle.rs"]
mod grid_oracle;

const GRID: f64 = (1u32 << 20) as f64;

/// A mesh on the grid, as numbers and as integers.
struct Snapped {
    mesh: TriMesh,
    points: Vec<GridPoint>,
    /// Smallest and largest coordinates of every face.
    boxes: Vec<[[i32; 3]; 2]>,
}

impl Snapped {
    fn new(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Self {
        let on_grid: Vec<[i32; 3]> = positions.iter().map(|p| p.map(|x| (x * GRID).round() as i32)).collect();
        let exact = on_grid.iter().map(|p| p.map(|x| f64::from(x) / GRID)).collect();
        let boxes = faces
            .iter()
            .map(|face| {
                let corners = face.map(|v| on_grid[v as usize]);
                let [a, b, c] = corners;
                [
                    std::array::from_fn(|k| a[k].min(b[k]).min(c[k])),
                    std::array::from_fn(|k| a[k].max(b[k]).max(c[k])),
                ]
            })
            .collect();
        Self {
            mesh: TriMesh::new(exact, faces.to_vec()).unwrap(),
            points: on_grid.iter().map(|p| p.map(i128::from)).collect(),
            boxes,
        }
    }

    fn triangle(&self, face: usize) -> [GridPoint; 3] {
        self.mesh.faces()[face].map(|v| self.points[v as usize])
    }

    fn tree(&self) -> TriangleTree<'_> {
        TriangleTree::new(self.mesh.positions(), self.mesh.faces())
    }
}

/// Two faces of one mesh. From a common corner through any other common point, a ray leaves one of the triangles first, by the
/// edge opposite to the corner, and is then still in the other one.
fn neighbours_meet(mesh: &Snapped, i: usize, j: usize) -> bool {
    let faces = [i, j].map(|face| mesh.mesh.faces()[face]);
    grid_oracle::mesh_triangles_intersect(&mesh.points, faces, |a, b| {
        grid_oracle::meet(&a[1..], b) || grid_oracle::meet(&b[1..], a)
    })
}

fn boxes_meet(a: &[[i32; 3]; 2], b: &[[i32; 3]; 2]) -> bool {
    (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}

/// Every pair of faces with boxes that meet and for which both tests, which must agree, say yes. `first_of_b(i)`: where the
/// second mesh begins for face `i`.
fn brute_force(
    a: &Snapped,
    b: &Snapped,
    first_of_b: impl Fn(usize) -> usize + Sync,
    oracle: impl Fn(usize, usize) -> bool + Sync,
    ours: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<(u32, u32)> {
    (0..a.boxes.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            let near = (first_of_b(i)..b.boxes.len()).filter(move |&j| boxes_meet(&a.boxes[i], &b.boxes[j]));
            let (oracle, ours) = (&oracle, &ours);
            near.filter_map(move |j| {
                let expected = oracle(i, j);
                assert_eq!(ours(i, j), expected, "triangles {i} and {j}");
                expected.then_some((i as u32, j as u32))
            })
        })
        .collect()
}

fn pairs_between(a: &Snapped, b: &Snapped) -> Vec<(u32, u32)> {
    let oracle = |i, j| grid_oracle::triangles_intersect(&a.triangle(i), &b.triangle(j));
    brute_force(a, b, |_| 0, oracle, |i, j| triangles_intersect(&a.mesh.corners(i), &b.mesh.corners(j)))
}

fn pairs_within(a: &Snapped) -> Vec<(u32, u32)> {
    let faces = a.mesh.faces();
    let ours = |i: usize, j: usize| mesh_triangles_intersect(a.mesh.positions(), faces[i], faces[j]);
    brute_force(a, a, |i| i + 1, |i, j| neighbours_meet(a, i, j), ours)
}

/// The report of `garments` on `body` against brute force, pair by pair.
fn check(body: &Snapped, garments: &[Snapped]) {
    let trees: Vec<TriangleTree> = garments.iter().map(Snapped::tree).collect();
    let meshes: Vec<ReportGarment> = garments
        .iter()
        .map(|g| ReportGarment { positions: g.mesh.positions(), faces: g.mesh.faces() })
        .collect();
    let selection = Selection {
        layers: &all_layers(garments.len()),
        order: LayerOrder::NearestVertex,
        triangles: true,
        body_itself: true,
    };
    let surface = Surface::from_mesh(&body.mesh);
    let report = Report::count(&CountedBody::new(&surface, Distance::ClosestPoint), &meshes, &selection);
    let mut total = 0;
    for (i, garment) in garments.iter().enumerate() {
        let (with_body, with_itself) = (pairs_between(garment, body), pairs_within(garment));
        assert_eq!(trees[i].pairs_with(&body.tree()), with_body);
        assert_eq!(trees[i].self_pairs(), with_itself);
        assert_eq!(report.garments[i].with_body.pairs, with_body);
        assert_eq!(report.garments[i].with_itself.pairs, with_itself);
        println!(
            "garment {i}: {} triangles, {} pairs with the body of {}, {} with itself",
            garment.boxes.len(),
            with_body.len(),
            body.boxes.len(),
            with_itself.len()
        );
        total += with_body.len() + with_itself.len();
    }
    for layer in &report.layers {
        let pairs = pairs_between(&garments[layer.outer], &garments[layer.inner]);
        assert_eq!(trees[layer.outer].pairs_with(&trees[layer.inner]), pairs);
        assert_eq!(layer.pairs.pairs, pairs);
        println!("garments {} and {}: {} pairs", layer.inner, layer.outer, pairs.len());
        total += pairs.len();
    }
    let of_the_body = pairs_within(body);
    assert_eq!(report.body_itself.pairs, of_the_body.len());
    println!("body with itself: {} pairs, in no total", of_the_body.len());
    // What the body does to itself is in no sum.
    assert_eq!(report.intersections().pairs, total);
    assert!(
        report.garments.iter().all(|g| !g.with_body.pairs.is_empty()),
        "garments that touch nothing test nothing"
    );
}

/// `garments` skinned onto the posed body.
fn posed(body: &Body, garments: &[Garment], shape: &[f64], pose: &Pose) -> (Snapped, Vec<Snapped>) {
    let posed = body.posed(shape, pose).unwrap();
    let skinned = garments.iter().map(|garment| {
        let binding = Binding::new(garment, body, &BindingSettings::default());
        Snapped::new(&binding.skinned(garment.rest.positions(), &posed.bones), garment.rest.faces())
    });
    (Snapped::new(&posed.positions, &body.faces), skinned.collect())
}

#[test]
fn generated_garments_on_the_mannequin_equal_brute_force() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    let garment = |category, seed| generator.generate(category, seed, 1500).unwrap();
    let garments = [garment(Category::TShirt, 3), garment(Category::Trousers, 4)];
    let mut pose = Pose::t_pose(22);
    pose.rotations[1] = [-1.6, 0.1, 0.2];
    pose.rotations[4] = [1.9, 0.0, 0.0];
    pose.rotations[16] = [0.1, -0.3, -1.2];
    pose.rotations[18] = [0.0, -2.0, 0.0];
    let (body, garments) = posed(&body, &garments, &[1.5, -1.0], &pose);
    check(&body, &garments);
}

#[test]
fn real_garments_on_the_real_body_equal_brute_force() {
    let open = Path::new(env!("CARGO_MANIFEST_DIR")).join("../datasets/open");
    if !open.join("body.npz").exists() {
        // Printed past the capture of the test harness: a check that did not run must not look like one that passed.
        let skipped =
            format!("SKIPPED real garments: {} is missing (scripts/open_data.sh makes it)\n", open.display());
        let _ = std::io::Write::write_all(&mut std::io::stderr(), skipped.as_bytes());
        return;
    }
    let body =
        Body::load(&open.join("body.npz"), &BodyFileSettings { shape_components: usize::MAX }).unwrap();
    let all = load_garment_folder(&open.join("garments"), &body).unwrap();
    let named = |name: &str| all.iter().find(|g| g.name == name).cloned();
    let garments =
        ["Tank_Top_01", "Coat"].map(|name| named(name).unwrap_or_else(|| panic!("no garment {name}")));
    let clips = load_motion_folder(&open.join("motions")).unwrap();
    let clip = clips.iter().find(|c| c.name == "Boxing_Toes").expect("the boxing clip");
    let pose = clip.poses[clip.poses.len() / 2].without_heading().0;
    let (body, garments) = posed(&body, &garments, &[1.0, -1.0, 0.5], &pose);
    check(&body, &garments);
}
