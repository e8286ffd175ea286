use crate::asset::{Body, Category};
use crate::fit::{
    FitError, FitSettings, Fitted, Keep, RepairKind, Unit, UpAxis, fit, is_on_body, needs_repair,
};
use crate::format::obj::{MovedObj, RepairedForm};
use crate::format::{PolygonMesh, parse_mesh};
use crate::generate::garment::generated;
use crate::generate::mannequin;
use crate::mesh::{MeshMeasures, solidified};
use clothcombo_physics::contact::self_triangle_pairs;
use clothcombo_physics::mesh::{Hinge, vertex_normals};
use clothcombo_physics::vec3::{add_scaled, norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use std::collections::HashSet;
use std::path::Path;

/// Centimetres, z up.
const CM_Z: FitSettings = FitSettings {
    unit: Some(Unit::Cm),
    up: Some(UpAxis::Z),
    arms_lowered: Some(false),
    legs_degrees: None,
    category: None,
    offset: None,
    turn_degrees: None,
    keep: Keep::All,
    join_seams: None,
    from_body: None,
};

fn cm_z(positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
    positions.iter().map(|[x, y, z]| [100.0 * x, -100.0 * z, 100.0 * y]).collect()
}

/// Some pairs of triangles as quads, so that the quad's first diagonal is the edge between them.
fn quads(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut taken = HashSet::new();
    let mut polygons = Vec::new();
    for Hinge { edge: [a, b], opposite: [c, d], faces } in Topology::new(mesh).hinges {
        if faces.iter().all(|f| !taken.contains(f)) {
            taken.extend(faces);
            polygons.push(vec![a, d, b, c]);
        }
    }
    let rest = mesh.faces().iter().zip(0u32..).filter(|(_, f)| !taken.contains(f));
    polygons.extend(rest.map(|(face, _)| face.to_vec()));
    polygons
}

/// An OBJ text with a texture coordinate for every vertex, two groups and materials.
fn text(positions: &[[f64; 3]], polygons: &[Vec<u32>]) -> String {
    let mut text = "mtllib cloth.mtl\n".to_owned();
    for [x, y, z] in positions {
        text += &format!("v {x} {y} {z}\nvt {:.4} {:.4}\n", 0.01 * x, 0.01 * z);
    }
    for (number, polygon) in polygons.iter().enumerate() {
        match number {
            0 => text += "g front\nusemtl wool\n",
            40 => text += "g back\nusemtl linen\n",
            _ => {}
        }
        text += "f";
        polygon.iter().for_each(|v| text += &format!(" {}/{}", v + 1, v + 1));
        text += "\n";
    }
    text
}

struct Written {
    text: String,
    mesh: TriMesh,
    fitted: Fitted,
}

/// Fits a file and reads what is written of it.
fn written(text: &str, body: &Body, settings: &FitSettings) -> Written {
    let path = Path::new("given.obj");
    let file = parse_mesh(text.as_bytes(), path).unwrap();
    let fitted = fit(&file, body, settings).unwrap();
    let form = RepairedForm {
        positions: fitted.garment.rest.positions(),
        vertex_origin: &fitted.vertex_origin,
        faces: &fitted.file_faces,
    };
    let moved = MovedObj::repaired(path, text.as_bytes(), &form, "given").unwrap();
    let mesh = parse_mesh(&moved.obj, path).unwrap().to_tri_mesh(path).unwrap();
    Written { text: String::from_utf8(moved.obj).unwrap(), mesh, fitted }
}

fn sorted(faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    // A triangle may begin at any of its corners.
    let first = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    let mut faces: Vec<[u32; 3]> = faces.iter().copied().map(first).collect();
    faces.sort_unstable();
    faces
}

/// What is read is what was fitted, and needs no repair.
fn assert_reads_back(written: &Written, body: &Body) {
    let rest = &written.fitted.garment.rest;
    assert_eq!(sorted(written.mesh.faces()), sorted(rest.faces()));
    assert_eq!(written.mesh.vertex_count(), rest.vertex_count());
    for (p, q) in written.mesh.positions().iter().zip(rest.positions()) {
        assert!(norm(sub(*p, *q)) < 1e-6);
    }
    let defects = MeshMeasures::new(&written.mesh, &Topology::new(&written.mesh)).defects;
    assert!(defects.counts().is_empty(), "{:?}", defects.counts());
    assert!(is_on_body(&written.mesh, body) && !needs_repair(&written.mesh));
}

fn lines<'a>(text: &'a str, keys: &[&str]) -> Vec<&'a str> {
    text.lines().filter(|l| keys.iter().any(|k| l.split(' ').next() == Some(*k))).collect()
}

#[test]
fn quads_texture_groups_and_order_stay_where_nothing_is_wrong() {
    let body = mannequin();
    let rest = generated(&body, Category::TShirt, 1, 500).rest;
    let given = text(&cm_z(rest.positions()), &quads(&rest));
    let written = written(&given, &body, &CM_Z);
    let keys = ["f", "vt", "g", "usemtl"];
    assert_eq!(lines(&written.text, &keys), lines(&given, &keys));
    assert_eq!(written.fitted.vertex_origin, (0..rest.vertex_count() as u32).collect::<Vec<_>>());
    for (p, q) in written.mesh.positions().iter().zip(rest.positions()) {
        assert!(norm(sub(*p, *q)) < 1e-3);
    }
    assert_reads_back(&written, &body);
}

#[test]
fn what_was_repaired_reads_back_clean_and_the_rest_keeps_its_form() {
    let body = mannequin();
    let rest = generated(&body, Category::Dress, 2, 500).rest;
    let (mut positions, mut polygons) = (cm_z(rest.positions()), quads(&rest));
    // Vertices of the first faces twice, as along the seams of a texture; one turned; one twice; a flap; a stray vertex.
    for polygon in polygons.iter_mut().take(30) {
        for v in polygon {
            positions.push(positions[*v as usize]);
            *v = positions.len() as u32 - 1;
        }
    }
    polygons[50].reverse();
    polygons.push(polygons[60].clone());
    let [a, b] = [polygons[70][0], polygons[70][2]];
    positions.push(positions[a as usize].map(|x| 1.3 * x));
    polygons.push(vec![a, b, positions.len() as u32 - 1]);
    positions.push([0.0, 0.0, 1e3]);
    let given = text(&positions, &polygons);
    let written = written(&given, &body, &FitSettings { keep: Keep::Largest, ..CM_Z });
    assert_reads_back(&written, &body);
    assert_eq!(written.mesh.vertex_count(), rest.vertex_count());
    let kinds: Vec<RepairKind> = written.fitted.report.repairs.iter().map(|r| r.kind).collect();
    assert!(
        kinds.contains(&RepairKind::DroppedPieces) && kinds.contains(&RepairKind::TurnedFaces),
        "{kinds:?}"
    );
    assert_eq!(written.fitted.report.dropped_pieces.len(), 1);
    let quads = |text: &str| lines(text, &["f"]).iter().filter(|l| l.split(' ').count() == 5).count();
    assert!(quads(&written.text) + 2 >= quads(&given) - 1, "{} of {}", quads(&written.text), quads(&given));
    assert_eq!(lines(&written.text, &["vt", "g", "usemtl"]), lines(&given, &["vt", "g", "usemtl"]));
    assert!(lines(&written.text, &["f"]).iter().all(|l| l.matches('/').count() >= 3));
}

#[test]
fn unsewn_panels_are_joined_named_or_joined_on_request() {
    let body = mannequin();
    let rest = generated(&body, Category::Skirt, 4, 500).rest;
    let panels = |gap: f64| {
        let (mut positions, mut polygons) = (Vec::new(), Vec::new());
        for side in [-1.0, 1.0] {
            let mut number = vec![None; rest.vertex_count()];
            for face in rest.faces() {
                let x: f64 = face.iter().map(|v| rest.positions()[*v as usize][0]).sum();
                if (x >= 0.0) == (side > 0.0) {
                    polygons.push(
                        face.map(|v| {
                            *number[v as usize].get_or_insert_with(|| {
                                let [x, y, z] = rest.positions()[v as usize];
                                positions.push([x + 0.5 * side * gap, y, z]);
                                positions.len() as u32 - 1
                            })
                        })
                        .to_vec(),
                    );
                }
            }
        }
        text(&cm_z(&positions), &polygons)
    };
    let whole = Topology::new(&rest);
    let pieces = |fitted: &Fitted| {
        (fitted.report.pieces.len(), fitted.report.pieces.iter().map(|p| p.boundary_loops).sum::<usize>())
    };
    let close = written(&panels(0.0004), &body, &CM_Z);
    assert_eq!(pieces(&close.fitted), (1, whole.boundary_loops.len()));
    assert!(close.fitted.report.seams.iter().any(|s| s.joined && s.gap_mm < 0.5));
    assert_reads_back(&close, &body);

    let wide = written(&panels(0.004), &body, &CM_Z);
    assert_eq!(pieces(&wide.fitted).0, 2);
    let open: Vec<_> = wide.fitted.report.seams.iter().filter(|s| !s.joined).collect();
    assert!(open.len() == 2 && open.iter().all(|s| (2.0..=4.5).contains(&s.gap_mm)), "{open:?}");
    let report = wide.fitted.report.to_string();
    assert!(report.contains("open      2 seams") && report.contains("--join-seams "), "{report}");

    let joined = written(&panels(0.004), &body, &FitSettings { join_seams: Some(0.005), ..CM_Z });
    assert_eq!(pieces(&joined.fitted), (1, whole.boundary_loops.len()));
    assert!(joined.fitted.report.seams.iter().all(|seam| seam.joined));
    assert_reads_back(&joined, &body);

    // A notch in one border is wider than what is joined: the seam closes around it, and the gap is named.
    let mut notched: PolygonMesh = parse_mesh(panels(0.004).as_bytes(), Path::new("notched.obj")).unwrap();
    let border = &Topology::new(&notched.to_tri_mesh(Path::new("notched.obj")).unwrap()).boundary_loops[0];
    let is_upright = |v: &&u32| notched.positions[**v as usize][0].abs() < 2.0;
    let upright: Vec<u32> = border.iter().filter(is_upright).copied().collect();
    assert!(upright.len() > 4);
    let at = upright[upright.len() / 4] as usize;
    notched.positions[at][0] += 1.5 * notched.positions[at][0].signum();
    let report = fit(&notched, &body, &FitSettings { join_seams: Some(0.005), ..CM_Z }).unwrap().report;
    let loops = report.pieces.iter().map(|piece| piece.boundary_loops).sum::<usize>();
    let gaps = report.seams.iter().filter(|seam| !seam.joined).count();
    assert!(loops > whole.boundary_loops.len() && gaps == loops - whole.boundary_loops.len(), "{report}");
}

#[test]
fn thick_cloth_is_refused_kept_outside_and_written_with_its_thickness() {
    let body = mannequin();
    for (category, seed) in Category::ALL.into_iter().zip(2..) {
        let rest = generated(&body, category, seed, 600).rest;
        let (positions, polygons) = solidified(&rest, 0.003);
        let given = text(&cm_z(&positions), &polygons);
        let file: PolygonMesh = parse_mesh(given.as_bytes(), Path::new("thick.obj")).unwrap();
        let refused = fit(&file, &body, &CM_Z).unwrap_err();
        assert!(
            matches!(refused, FitError::Thickness { thickness, .. } if (thickness - 0.3).abs() < 0.03),
            "{refused}"
        );
        assert!(refused.to_string().contains("--keep outer"));

        let thin = written(&given, &body, &FitSettings { keep: Keep::Outer, ..CM_Z });
        assert_reads_back(&thin, &body);
        assert_eq!(sorted(thin.mesh.faces()), sorted(rest.faces()), "{category}");
        let mut distances: Vec<f64> =
            thin.mesh.positions().iter().zip(rest.positions()).map(|(p, q)| norm(sub(*p, *q))).collect();
        distances.sort_by(f64::total_cmp);
        assert!(distances[distances.len() / 2] < 1e-4, "{category}");

        let again = thin.fitted.in_file_order(thin.fitted.garment.rest.positions());
        let moved = thin.fitted.report.contact.largest_move_mm;
        // Whichever side its faces look at, the inner sheet comes back inside.
        let reversed: Vec<Vec<u32>> =
            polygons.iter().map(|p| p.iter().rev().copied().collect::<Vec<u32>>()).collect();
        let reversed = text(&cm_z(&positions), &reversed);
        let turned = written(&reversed, &body, &FitSettings { keep: Keep::Outer, ..CM_Z }).fitted;
        for again in [&again, &turned.in_file_order(turned.garment.rest.positions())] {
            for (p, q) in again.iter().zip(&positions) {
                assert!(norm(sub(*p, *q)) < 1e-3 * (1.0 + 1.5 * moved), "{category}");
            }
        }
        let faces: Vec<[u32; 3]> = polygons.iter().flat_map(|p| crate::mesh::fan(p, 0)).collect();
        let pairs = |positions: &[[f64; 3]]| self_triangle_pairs(positions, &faces).len();
        assert!(moved > 0.5 || pairs(&again) <= pairs(&positions), "{category}");
    }
}

#[test]
fn a_lining_is_refused_however_its_faces_look() {
    let body = mannequin();
    let rest = generated(&body, Category::TShirt, 5, 500).rest;
    let normals = vertex_normals(rest.positions(), rest.faces());
    let lining = rest.positions().iter().zip(&normals).map(|(p, n)| add_scaled(*p, -0.004, *n));
    let positions: Vec<[f64; 3]> = rest.positions().iter().copied().chain(lining).collect();
    let count = rest.vertex_count() as u32;
    let outer = rest.faces().iter().map(|f| f.to_vec());
    let same = rest.faces().iter().map(|f| f.map(|v| v + count).to_vec());
    let reversed = rest.faces().iter().map(|[a, b, c]| vec![a + count, c + count, b + count]);
    let facing = rest.faces().iter().map(|[a, b, c]| vec![*a, *c, *b]);
    {
        let polygons: Vec<Vec<u32>> = outer.chain(same.clone()).collect();
        let file = parse_mesh(text(&cm_z(&positions), &polygons).as_bytes(), Path::new("lined.obj")).unwrap();
        let refused = fit(&file, &body, &CM_Z).unwrap_err();
        assert!(refused.to_string().contains("--keep largest"), "{refused}");
        let one = fit(&file, &body, &FitSettings { keep: Keep::Largest, ..CM_Z }).unwrap();
        assert_eq!(one.garment.rest.face_count(), rest.face_count());
    }
    let polygons: Vec<Vec<u32>> = facing.chain(same).collect();
    let file = parse_mesh(text(&cm_z(&positions), &polygons).as_bytes(), Path::new("facing.obj")).unwrap();
    assert!(fit(&file, &body, &CM_Z).is_err(), "sheets that face each other");
    let polygons: Vec<Vec<u32>> = rest.faces().iter().map(|f| f.to_vec()).chain(reversed).collect();
    let file = parse_mesh(text(&cm_z(&positions), &polygons).as_bytes(), Path::new("away.obj")).unwrap();
    assert!(fit(&file, &body, &CM_Z).is_err(), "sheets that face away");
}
