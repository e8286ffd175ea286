use super::*;
use crate::asset::Category;
use crate::generate::garment::generated;
use crate::generate::mannequin;
use crate::mesh::attachment::attach;
use clothcombo_physics::contact::self_triangle_pairs;
use clothcombo_physics::mesh::shapes::{icosphere, tube};
use clothcombo_physics::mesh::vertex_normals;
use clothcombo_physics::vec3::{add_scaled, sub};
use clothcombo_physics::{Topology, TriMesh};

/// Vertices of both sheets, the outer ones first, and polygons: outer and inner triangles, and the rims as quads.
pub(crate) fn solidified(outer: &TriMesh, thickness: f64) -> (Vec<[f64; 3]>, Vec<Vec<u32>>) {
    let normals = vertex_normals(outer.positions(), outer.faces());
    let inner = outer.positions().iter().zip(&normals).map(|(p, n)| add_scaled(*p, -thickness, *n));
    let positions: Vec<[f64; 3]> = outer.positions().iter().copied().chain(inner).collect();
    let count = outer.vertex_count() as u32;
    let mut polygons: Vec<Vec<u32>> = outer.faces().iter().map(|f| f.to_vec()).collect();
    polygons.extend(outer.faces().iter().map(|[a, b, c]| vec![a + count, c + count, b + count]));
    for rim in Topology::new(outer).boundary_loops {
        for (k, a) in rim.iter().enumerate() {
            let b = rim[(k + 1) % rim.len()];
            polygons.push(vec![b, *a, a + count, b + count]);
        }
    }
    (positions, polygons)
}

pub(crate) fn triangles(polygons: &[Vec<u32>]) -> Vec<[u32; 3]> {
    polygons.iter().flat_map(|p| crate::mesh::fan(p, 0)).collect()
}

#[test]
fn the_outer_sheet_of_any_thickness_is_the_garment() {
    let body = mannequin();
    for (category, seed) in Category::ALL.into_iter().zip(1..) {
        let garment = generated(&body, category, seed, 900).rest;
        for millimetres in [1.0, 3.0, 8.0] {
            let (positions, polygons) = solidified(&garment, 1e-3 * millimetres);
            let faces = triangles(&polygons);
            let found = thickness(&positions, &faces).map(|t| 1e3 * t);
            assert!(
                found.is_some_and(|t| (t / millimetres - 1.0).abs() < 0.1),
                "{category} {millimetres}: {found:?}"
            );
            let outer = outer_sheet(&positions, &faces);
            assert_eq!(
                outer,
                (0..garment.face_count() as u32).collect::<Vec<_>>(),
                "{category} {millimetres} mm"
            );
        }
        assert_eq!(thickness(garment.positions(), garment.faces()), None, "{category}");
    }
}

#[test]
fn sheets_without_rims_are_told_apart() {
    let garment = generated(&mannequin(), Category::TShirt, 2, 700).rest;
    let (positions, polygons) = solidified(&garment, 0.004);
    let sheets = triangles(&polygons[..2 * garment.face_count()]);
    assert!(thickness(&positions, &sheets).is_some());
    assert_eq!(outer_sheet(&positions, &sheets).len(), garment.face_count());
}

#[test]
fn bodies_balls_and_tubes_are_not_thick() {
    let body = mannequin().zero_body();
    for mesh in [body, icosphere(0.3, 3), tube(0.2, 0.5, 24, 8)] {
        assert_eq!(thickness(mesh.positions(), mesh.faces()), None);
    }
}

#[test]
fn the_inner_side_follows_the_outer_one() {
    let body = mannequin();
    for (category, seed) in Category::ALL.into_iter().zip(1..) {
        let garment = generated(&body, category, seed, 900).rest;
        let (positions, polygons) = solidified(&garment, 0.004);
        let inner = &positions[garment.vertex_count()..];
        let attached = attach(inner, garment.positions(), garment.faces()).unwrap();
        let normals = vertex_normals(garment.positions(), garment.faces());
        let again: Vec<[f64; 3]> =
            attached.iter().map(|a| a.position(garment.positions(), &normals)).collect();
        let worst = again.iter().zip(inner).map(|(p, q)| norm(sub(*p, *q))).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{category}: {worst}");
        let faces = triangles(&polygons);
        let pairs =
            |inner: &[[f64; 3]]| self_triangle_pairs(&[garment.positions(), inner].concat(), &faces).len();
        assert!(pairs(&again) <= pairs(inner));
    }
}
