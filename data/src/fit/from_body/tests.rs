use super::super::limb_pose::{LimbPose, limb_pose};
use super::*;
use crate::asset::{Binding, BindingSettings, BodyParts, Garment, Pose, SparseSkinWeights};
use crate::fit::{Fitted, fit};
use crate::format::{NpzWriter, PolygonMesh, obj};
use crate::generate::garment::generated;
use crate::generate::mannequin;
use crate::mesh::{clean_faces, compact, weld};
use clothcombo_physics::mesh::shapes::icosphere;
use clothcombo_physics::vec3::{add, scale};
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

fn polygons(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> PolygonMesh {
    let mut mesh = PolygonMesh::with_positions(positions.to_vec());
    faces.iter().for_each(|f| mesh.push(f));
    mesh
}

fn moved(positions: &[[f64; 3]], by: [f64; 3]) -> Vec<[f64; 3]> {
    positions.iter().map(|p| add(*p, by)).collect()
}

fn through(source: &str, category: Category) -> FitSettings {
    let from_body = Some(Arc::new(SourceBody::load(source).unwrap()));
    FitSettings { from_body, category: Some(category), ..FitSettings::default() }
}

/// Median and 95th percentile of the distances (m) of the fitted garment to where it was made.
fn errors(fitted: &Fitted, garment: &Garment) -> [f64; 2] {
    let positions = fitted.garment.rest.positions();
    let pairs = fitted.vertex_of_file.iter().zip(garment.rest.positions());
    let mut distances: Vec<f64> =
        pairs.filter_map(|(v, p)| Some(norm(sub(positions[(*v)? as usize], *p)))).collect();
    assert!(distances.len() * 100 > 95 * garment.rest.vertex_count());
    distances.sort_by(f64::total_cmp);
    [distances[distances.len() / 2], distances[distances.len() * 95 / 100]]
}

/// Writes a body as its publisher does: in coordinates in which its pelvis is at `pelvis`, with a joint regressor where
/// it has shapes.
fn publish(body: &Body, pelvis: [f64; 3], path: &Path) {
    let (v, j, k) = (body.vertex_count(), body.joint_count(), body.shape_count);
    let parents = body.parents.iter().map(|p| p.map_or(-1, |p| p as i64)).chain(0..j as i64);
    let mut npz = NpzWriter::new();
    npz.f64("v_template", &[v, 3], moved(&body.template, pelvis).as_flattened())
        .u32("f", &[body.faces.len(), 3], body.faces.as_flattened())
        .f32("weights", &[v, j], &body.skin_weights.to_dense(j))
        .i64("kintree_table", &[2, j], &parents.collect::<Vec<_>>())
        .f64("J_template", &[j, 3], moved(&body.joint_template, pelvis).as_flattened())
        .strings("joint_names", &[j], &body.joint_names);
    if k > 0 {
        // The pelvis rises with the first shape component.
        let rises = |i: usize| if i % (3 * k) == k { 0.01 } else { 0.0 };
        let vertices: Vec<f32> =
            body.shape_directions.iter().enumerate().map(|(i, d)| d + rises(i) as f32).collect();
        let joints: Vec<f64> =
            body.joint_shape_directions.iter().enumerate().map(|(i, d)| d + rises(i)).collect();
        npz.f32("shapedirs", &[v, 3, k], &vertices).f64("J_shapedirs", &[j, 3, k], &joints);
    }
    npz.save(path).unwrap();
}

/// A coarser body of this shape with its own vertices and two more joints, as SMPL has.
fn decimated(body: &Body, beta: &[f64]) -> Body {
    let shaped = body.shaped(beta).unwrap();
    let welded = weld(&shaped.positions, 0.025);
    let faces: Vec<[u32; 3]> = body.faces.iter().map(|f| f.map(|v| welded.number[v as usize])).collect();
    let clean = clean_faces(&welded.positions, &faces, 1e-9);
    let (used, faces) = compact(clean.kept.iter().map(|f| faces[*f as usize]), welded.positions.len());
    let dense = body.skin_weights.to_dense(body.joint_count());
    let (j, more) = (body.joint_count(), 24 - body.joint_count());
    let weights: Vec<f32> = used
        .iter()
        .flat_map(|v| {
            let origin = welded.origin[*v as usize] as usize;
            dense[origin * j..(origin + 1) * j].iter().copied().chain(vec![0.0; more])
        })
        .collect();
    assert!(2 * used.len() < body.vertex_count(), "{} of {}", used.len(), body.vertex_count());
    let hands = [20, 21].map(|wrist| shaped.joints[wrist]);
    Body::new(BodyParts {
        name: "other".into(),
        faces: faces.into(),
        template: used.iter().map(|v| welded.positions[*v as usize]).collect(),
        shape_directions: Vec::new(),
        shape_count: 0,
        joint_template: shaped.joints.iter().copied().chain(hands).take(24).collect(),
        joint_shape_directions: Vec::new(),
        pose_directions: None,
        skin_weights: SparseSkinWeights::from_dense(&weights, 24),
        parents: body.parents.iter().copied().chain([Some(20), Some(21)]).take(24).collect(),
        joint_names: crate::asset::skeleton::joint_names(24),
    })
    .unwrap()
}

/// A garment as draping starts it on a shaped and posed body.
fn worn(garment: &Garment, body: &Body, beta: &[f64], pose: &Pose) -> Vec<[f64; 3]> {
    let binding = Binding::new(garment, body, &BindingSettings::default());
    let displacement = binding.shape_displacement(beta, body.shape_count);
    let shaped: Vec<_> =
        garment.rest.positions().iter().zip(&displacement).map(|(p, d)| add(*p, *d)).collect();
    binding.skinned(&shaped, &body.posed(beta, pose).unwrap().bones)
}

fn at(folder: &TempDir, name: &str) -> String {
    folder.path().join(name).display().to_string()
}

const CATEGORIES: [Category; 3] = [Category::TShirt, Category::Trousers, Category::Dress];

#[test]
fn the_shape_of_the_same_model_is_undone() {
    let (body, folder) = (mannequin(), tempfile::tempdir().unwrap());
    let file = at(&folder, "body.npz");
    publish(&body, [0.0; 3], Path::new(&file));
    let beta = [1.2, -0.8, 0.5];
    for category in CATEGORIES {
        let garment = generated(&body, category, 3, 700);
        // The published pelvis rises by a centimetre per unit of the first component.
        let made = moved(&worn(&garment, &body, &beta, &Pose::t_pose(22)), [0.0, 0.012, 0.0]);
        let settings = through(&format!("{file}:1.2,-0.8,0.5"), category);
        let fitted = fit(&polygons(&made, garment.rest.faces()), &body, &settings).unwrap();
        let [median, p95] = errors(&fitted, &garment);
        eprintln!(
            "shape {category}: median {:.2} p95 {:.2} mm; {}",
            1e3 * median,
            1e3 * p95,
            fitted.report.from_body.as_ref().unwrap().text()
        );
        assert!(median < 0.003 && p95 < 0.01, "{category}: {median} {p95}");
    }
}

#[test]
fn an_origin_above_the_pelvis_is_undone_exactly() {
    let (body, folder) = (mannequin(), tempfile::tempdir().unwrap());
    let (file, imported) = (at(&folder, "a:b.npz"), at(&folder, "imported.npz"));
    let pelvis = [0.01, -0.22, 0.03];
    publish(&body, pelvis, Path::new(&file));
    let read = Body::load(Path::new(&file), &Default::default()).unwrap();
    read.save(Path::new(&imported), &Default::default()).unwrap();
    for category in CATEGORIES {
        let garment = generated(&body, category, 5, 700);
        let made = polygons(&moved(garment.rest.positions(), pelvis), garment.rest.faces());
        let moved_already = polygons(garment.rest.positions(), garment.rest.faces());
        // The imported file still knows its origin; a garment in the coordinates of the moved body says so.
        let moved_hint = Some([0.0; 3]);
        for (mesh, source, offset) in
            [(&made, &file, None), (&made, &imported, None), (&moved_already, &imported, moved_hint)]
        {
            let settings = FitSettings { offset, ..through(source, category) };
            let fitted = fit(mesh, &body, &settings).unwrap();
            let [median, p95] = errors(&fitted, &garment);
            assert!(median < 1e-6 && p95 < 1e-6, "{category} {source}: {median} {p95}");
            assert_eq!(fitted.report.placement.origin, FileOrigin::SourceBody);
        }
    }
}

#[test]
fn another_model_is_matched_joint_by_joint() {
    let (body, folder) = (mannequin(), tempfile::tempdir().unwrap());
    let (file, slim) = (at(&folder, "other.npz"), at(&folder, "slim.npz"));
    let pelvis = [0.0, -0.35, 0.02];
    let beta = [1.0, -0.8, 0.5];
    publish(&decimated(&body, &[]), pelvis, Path::new(&file));
    publish(&decimated(&body, &beta), pelvis, Path::new(&slim));
    for category in CATEGORIES {
        let garment = generated(&body, category, 7, 700);
        let shaped = worn(&garment, &body, &beta, &Pose::t_pose(22));
        for (made, source, limit) in [(garment.rest.positions(), &file, 0.005), (&shaped[..], &slim, 0.012)] {
            let mesh = polygons(&moved(made, pelvis), garment.rest.faces());
            let fitted = fit(&mesh, &body, &through(source, category)).unwrap();
            let [median, p95] = errors(&fitted, &garment);
            let how = fitted.report.from_body.unwrap();
            eprintln!("other {category}: median {:.2} p95 {:.2} mm; {}", 1e3 * median, 1e3 * p95, how.text());
            assert!(median < limit && how.carried == Carried::Bones, "{category}: {median} {p95}");
        }
    }
}

/// Metres with y up as a file in centimetres, z up, its front to the side, has them.
fn in_cm_z_up(positions: &[[f64; 3]], up: f64) -> Vec<[f64; 3]> {
    positions.iter().map(|[x, y, z]| scale([*z, *x, y + up], 100.0)).collect()
}

#[test]
fn a_mesh_of_other_vertices_in_an_a_pose_is_registered() {
    let (body, folder) = (mannequin(), tempfile::tempdir().unwrap());
    // The mean body with its legs together, and another one with its legs apart.
    let cases: [(&[f64], f64, f64); 2] = [(&[], 0.0, 0.005), (&[0.6, -0.5, 0.4], 7.0, 0.005)];
    for (number, (beta, legs, limit)) in cases.into_iter().enumerate() {
        let other = decimated(&body, beta);
        let posed = LimbPose::new(&other, &[], [40.0, legs]).unwrap();
        let up = -posed.positions.iter().map(|p| p[1]).fold(0.0, f64::min);
        let file = at(&folder, &format!("body{number}.obj"));
        obj::save(Path::new(&file), &in_cm_z_up(&posed.positions, up), &other.faces, &[]).unwrap();
        for category in CATEGORIES {
            let garment = generated(&body, category, 9, 700);
            let pose = limb_pose(&body, [40.0, legs]);
            let made = in_cm_z_up(&worn(&garment, &body, beta, &pose), up);
            let mesh = polygons(&made, garment.rest.faces());
            let fitted = fit(&mesh, &body, &through(&file, category)).unwrap();
            let placement = fitted.report.placement;
            let [median, p95] = errors(&fitted, &garment);
            let how = fitted.report.from_body.clone().unwrap();
            eprintln!(
                "mesh {category} {beta:?}: median {:.2} p95 {:.2} mm; {placement:?} {}",
                1e3 * median,
                1e3 * p95,
                how.text()
            );
            assert_eq!((placement.unit, placement.up), (Unit::Cm, UpAxis::Z));
            assert!((placement.arm_angle_degrees - 40.0).abs() < 4.0 && how.carried == Carried::Registration);
            assert!(median < limit, "{category}: {median} {p95}");
        }
    }
}

#[test]
fn pose_and_shape_of_a_mesh_of_the_same_vertices_are_undone() {
    let (body, folder) = (mannequin(), tempfile::tempdir().unwrap());
    let beta = [0.9, -0.6, 0.4];
    let mut pose = Pose::t_pose(22);
    pose.rotations[16] = [0.1, 0.2, -0.8];
    pose.rotations[17] = [0.0, -0.2, 0.6];
    pose.rotations[1] = [-0.3, 0.0, 0.15];
    let posed = body.posed(&beta, &pose).unwrap().positions;
    let file = at(&folder, "scan.ply.obj");
    obj::save(Path::new(&file), &in_cm_z_up(&posed, 0.9), &body.faces, &[]).unwrap();
    for category in CATEGORIES {
        let garment = generated(&body, category, 11, 700);
        let made = in_cm_z_up(&worn(&garment, &body, &beta, &pose), 0.9);
        let fitted = fit(&polygons(&made, garment.rest.faces()), &body, &through(&file, category)).unwrap();
        let [median, p95] = errors(&fitted, &garment);
        let how = fitted.report.from_body.unwrap();
        eprintln!("posed {category}: median {:.2} p95 {:.2} mm; {}", 1e3 * median, 1e3 * p95, how.text());
        assert!(
            how.carried == Carried::PoseAndShape && median < 0.003 && p95 < 0.015,
            "{category}: {median} {p95}"
        );
    }
}

#[test]
fn what_is_no_body_and_what_contradicts_it_is_refused() {
    let (body, folder) = (mannequin(), tempfile::tempdir().unwrap());
    let (npz, ball, text) = (at(&folder, "body.npz"), at(&folder, "ball.obj"), at(&folder, "body.txt"));
    publish(&body, [0.0; 3], Path::new(&npz));
    std::fs::write(&text, "x").unwrap();
    let sphere = icosphere(0.85, 4);
    let stretched: Vec<[f64; 3]> = sphere.positions().iter().map(|[x, y, z]| [*x, *y, 0.6 * z]).collect();
    obj::save(Path::new(&ball), &stretched, sphere.faces(), &[]).unwrap();
    for (source, part) in [
        (format!("{npz}:{}", vec!["0"; 99].join(",")), "99 shape numbers"),
        (format!("{npz}:1,b"), "'b', which is no number"),
        (format!("{ball}:1"), "mesh has its own shape"),
        (text, "a source body is"),
        (at(&folder, "none.npz:1"), "none.npz"),
    ] {
        let message = SourceBody::load(&source).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let garment = generated(&body, Category::TShirt, 3, 500);
    let refused = |positions: &[[f64; 3]], settings: &FitSettings| {
        fit(&polygons(positions, garment.rest.faces()), &body, settings).unwrap_err().to_string()
    };
    let on = |source: &str| through(source, Category::TShirt);
    let message = refused(garment.rest.positions(), &on(&ball));
    assert!(
        message.contains("ball.obj") && (message.contains("mm apart") || message.contains("not plain")),
        "{message}"
    );
    let offset = FitSettings { offset: Some([0.0; 3]), ..on(&ball) };
    assert!(refused(garment.rest.positions(), &offset).contains("leave --offset out"));
    let message = refused(&moved(garment.rest.positions(), [0.0, 0.9, 0.0]), &on(&npz));
    assert!(message.contains("does not lie on this body"), "{message}");
}
