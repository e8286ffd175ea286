use super::*;
use crate::asset::Category;
use crate::generate::garment::generated;
use crate::generate::mannequin;
use crate::mesh::{MeshMeasures, join_faces, orient, split_fans};
use clothcombo_physics::vec3::{add, norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Components, boundary loops and Euler characteristic.
fn shape(mesh: &TriMesh) -> (usize, usize, i64) {
    let topology = Topology::new(mesh);
    let euler = mesh.vertex_count() as i64 - topology.edges.len() as i64 + mesh.face_count() as i64;
    (topology.component_count, topology.boundary_loops.len(), euler)
}

/// The faces on both sides of `field`, each with vertices of its own.
fn cut(mesh: &TriMesh, side: impl Fn([f64; 3]) -> u32) -> TriMesh {
    let centre = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| mesh.positions()[v as usize]);
        add(add(a, b), c).map(|x| x / 3.0)
    };
    let mut number = std::collections::HashMap::new();
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for face in mesh.faces() {
        let panel = side(centre(face));
        faces.push(face.map(|v| {
            *number.entry((panel, v)).or_insert_with(|| {
                positions.push(mesh.positions()[v as usize]);
                positions.len() as u32 - 1
            })
        }));
    }
    TriMesh::new(positions, faces).unwrap()
}

fn jittered(mesh: &TriMesh, by: f64, seed: u64) -> TriMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let moved = mesh.positions().iter().map(|p| p.map(|x| x + rng.random_range(-by..by))).collect();
    mesh.with_positions(moved).unwrap()
}

fn joined(mesh: &TriMesh, reach: Option<f64>) -> (TriMesh, Vec<Seam>) {
    let Some(sheet) = join_seams(mesh.positions(), mesh.faces(), reach) else {
        return (mesh.clone(), Vec::new());
    };
    let mut faces = sheet.faces;
    let (links, crowded) = join_faces(&sheet.positions, &faces);
    assert!(crowded.is_empty());
    orient(&mut faces, &links);
    let split = split_fans(&sheet.positions, &faces, &links);
    (TriMesh::new(split.positions, split.faces).unwrap(), sheet.seams)
}

fn is_clean(mesh: &TriMesh) -> bool {
    MeshMeasures::new(mesh, &Topology::new(mesh)).defects.counts().is_empty()
}

#[test]
fn panels_that_nearly_coincide_become_the_garment_again() {
    let body = mannequin();
    for (category, seed) in Category::ALL.into_iter().zip(1..) {
        let whole = generated(&body, category, seed, 600).rest;
        let edge = whole.median_edge_length();
        // Four panels: front and back, left and right, which meet in points.
        let panels = cut(&whole, |[x, _, z]| u32::from(x > 0.013) + 2 * u32::from(z > 0.004));
        assert!(shape(&panels).0 > 1);
        let (exact, _) = joined(&panels, Some(1e-6));
        let (again, seams) = joined(&jittered(&panels, 0.012 * edge, seed), None);
        assert_eq!(shape(&again), shape(&exact), "{category}");
        assert_eq!(shape(&again), shape(&whole), "{category}: {seams:?}");
        assert_eq!(again.face_count(), whole.face_count());
        assert!(is_clean(&again) && !seams.is_empty());
        let index = clothcombo_physics::query::VertexIndex::new(whole.positions());
        for p in again.positions() {
            let nearest = whole.positions()[index.nearest(*p).0 as usize];
            assert!(norm(sub(*p, nearest)) < 0.05 * edge, "{category}");
        }
    }
}

#[test]
fn sewn_garments_have_nothing_to_join() {
    let body = mannequin();
    for category in Category::ALL {
        for seed in 1..5 {
            let rest = generated(&body, category, seed, 300 * seed as usize).rest;
            assert_eq!(join_seams(rest.positions(), rest.faces(), None), None, "{category} {seed}");
        }
    }
}

#[test]
fn a_panel_that_was_turned_inside_out_is_joined() {
    let whole = generated(&mannequin(), Category::Skirt, 3, 400).rest;
    let panels = cut(&whole, |[x, ..]| u32::from(x > 0.0));
    let topology = Topology::new(&panels);
    let turned = panels
        .faces()
        .iter()
        .map(|f| if topology.component_of_vertex[f[0] as usize] == 1 { [f[0], f[2], f[1]] } else { *f });
    let turned = TriMesh::new(panels.positions().to_vec(), turned.collect()).unwrap();
    let (again, _) = joined(&jittered(&turned, 0.012 * whole.median_edge_length(), 1), None);
    assert_eq!(shape(&again), shape(&whole));
    assert!(is_clean(&again));
}

/// A tube of `rows` by `around` quads, between the angles `from` and `to`.
fn panel(from: f64, to: f64, around: u32, rows: u32) -> TriMesh {
    let mut positions = Vec::new();
    for row in 0..=rows {
        for k in 0..=around {
            let angle = from + (to - from) * f64::from(k) / f64::from(around);
            positions.push([0.2 * angle.cos(), 0.5 * f64::from(row) / f64::from(rows), 0.2 * angle.sin()]);
        }
    }
    let index = |row: u32, k: u32| row * (around + 1) + k;
    let faces = (0..rows).flat_map(|r| {
        (0..around).flat_map(move |k| {
            [
                [index(r, k), index(r + 1, k), index(r + 1, k + 1)],
                [index(r, k), index(r + 1, k + 1), index(r, k + 1)],
            ]
        })
    });
    TriMesh::new(positions, faces.collect()).unwrap()
}

fn both(a: &TriMesh, b: &TriMesh) -> TriMesh {
    let offset = a.vertex_count() as u32;
    let faces = a.faces().iter().copied().chain(b.faces().iter().map(|f| f.map(|v| v + offset)));
    TriMesh::new([a.positions(), b.positions()].concat(), faces.collect()).unwrap()
}

#[test]
fn borders_with_other_vertices_are_joined_vertex_to_edge() {
    let pi = std::f64::consts::PI;
    for (rows, other) in [(10, 10), (10, 20), (10, 13), (10, 31), (7, 11)] {
        let halves = both(&panel(0.0, pi, 12, rows), &panel(pi, 2.0 * pi, 12, other));
        let (tube, seams) = joined(&jittered(&halves, 2e-4, u64::from(other)), None);
        assert_eq!(shape(&tube), (1, 2, 0), "{rows} and {other}: {seams:?}");
        assert!(is_clean(&tube), "{rows} and {other}");
        assert_eq!(seams.len(), 2);
        assert!(seams.iter().all(|s| s.is_joined && (s.length - 0.5).abs() < 0.06), "{seams:?}");
    }
}

#[test]
fn wide_gaps_are_named_and_joined_on_request_only() {
    let pi = std::f64::consts::PI;
    // 4 mm apart on each side.
    let halves = both(&panel(0.01, pi - 0.01, 12, 16), &panel(pi + 0.01, 2.0 * pi - 0.01, 12, 16));
    assert_eq!(join_seams(halves.positions(), halves.faces(), None), None);
    let named = open_seams(halves.positions(), halves.faces(), 0.01, 0.1);
    assert_eq!(named.len(), 2);
    assert!(named.iter().all(|s| (s.gap - 0.004).abs() < 1e-4 && !s.is_joined), "{named:?}");
    assert!(join_seams(halves.positions(), halves.faces(), Some(0.003)).is_none());
    let (tube, _) = joined(&halves, Some(0.005));
    assert_eq!(shape(&tube), (1, 2, 0));
    assert!(is_clean(&tube));
}

#[test]
fn cloth_that_only_touches_is_not_joined() {
    let tau = std::f64::consts::TAU;
    // Two trouser legs whose hems touch, and two layers with one hem.
    let leg = panel(0.0, tau, 24, 8);
    let (leg, _) = joined(&leg, None);
    assert_eq!(shape(&leg), (1, 2, 0));
    let moved = |dx: f64, s: f64| {
        let positions = leg.positions().iter().map(|[x, y, z]| [s * x + dx, *y, s * z]);
        leg.with_positions(positions.collect()).unwrap()
    };
    for other in [moved(0.4002, 1.0), moved(0.0, 0.99)] {
        let pair = both(&leg, &other);
        let (same, _) = joined(&pair, Some(0.005));
        assert_eq!(shape(&same), (2, 4, 0));
    }
}

#[test]
fn a_slit_closes_up_to_its_tip() {
    let slit = panel(-0.5, 0.5, 12, 12);
    // From the lower hem up to the middle: the lower six vertices of column 6 come twice.
    let mut positions = slit.positions().to_vec();
    let column: Vec<u32> = (0..6).map(|row| row * 13 + 6).collect();
    let first = positions.len() as u32;
    positions.extend(column.iter().map(|v| slit.positions()[*v as usize]));
    let faces = slit.faces().iter().map(|f| {
        let right = f.iter().any(|v| v % 13 > 6);
        f.map(|v| column.iter().position(|c| *c == v && right).map_or(v, |at| first + at as u32))
    });
    let cut = TriMesh::new(positions, faces.collect()).unwrap();
    let (again, seams) = joined(&jittered(&cut, 3e-4, 5), None);
    assert_eq!(shape(&again), shape(&slit));
    assert_eq!(again.vertex_count(), slit.vertex_count());
    assert_eq!(seams.len(), 1);
}

#[test]
fn no_soup_makes_an_edge_with_three_faces_or_a_face_without_area() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut changed = 0;
    for case in 0..300 {
        let count = rng.random_range(8..60);
        let positions: Vec<[f64; 3]> = (0..count)
            .map(|_| {
                std::array::from_fn(|_| f64::from(rng.random_range(0..4)) + rng.random_range(-0.02..0.02))
            })
            .collect();
        let soup: Vec<[u32; 3]> = (0..rng.random_range(20..80))
            .map(|_| std::array::from_fn(|_| rng.random_range(0..count as u32)))
            .collect();
        let clean = crate::mesh::clean_faces(&positions, &soup, 1e-9);
        let mut faces: Vec<[u32; 3]> = clean.kept.iter().map(|f| soup[*f as usize]).collect();
        let (links, _) = join_faces(&positions, &faces);
        orient(&mut faces, &links);
        let split = split_fans(&positions, &faces, &links);
        for reach in [None, Some(0.3), Some(2.0)] {
            let Some(sheet) = join_seams(&split.positions, &split.faces, reach) else { continue };
            changed += 1;
            assert_eq!(sheet.faces.len(), sheet.parent.len());
            assert!(
                crate::mesh::clean_faces(&sheet.positions, &sheet.faces, 0.0).degenerate.is_empty(),
                "{case}"
            );
            let mesh = TriMesh::new(sheet.positions, sheet.faces).unwrap();
            assert!(Topology::new(&mesh).non_manifold_edges.is_empty(), "{case}");
        }
    }
    assert!(changed > 100, "{changed}");
}
