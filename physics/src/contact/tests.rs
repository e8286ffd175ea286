//! Exact intersections against an oracle in integers.

use super::*;
use crate::mesh::TriMesh;
use crate::mesh::shapes::{SplitMix, grid, icosphere, irregular_grid, mapped, tube, union};
use crate::query::{Distance, Surface};
use grid_oracle::GridPoint;

mod grid_oracle;

type Point = GridPoint;

/// Two faces of one mesh. A common ray of both cones passes the far edge of the first; a far copy of the second reaches all of
/// that edge.
fn oracle_neighbours(points: &[Point], faces: [[u32; 3]; 2]) -> bool {
    grid_oracle::mesh_triangles_intersect(points, faces, |&[apex, p, q], &[_, r, s]| {
        let far = |p: Point| -> Point { std::array::from_fn(|k| apex[k] + 1_000_000 * (p[k] - apex[k])) };
        grid_oracle::meet(&[p, q], &[apex, far(r), far(s)])
    })
}

fn as_floats(points: &[Point]) -> Vec<[f64; 3]> {
    points.iter().map(|p| p.map(|x| x as f64)).collect()
}

fn random_mesh(random: &mut SplitMix, vertices: u64, faces: usize, size: u64) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut below = |n: u64| random.next_u64() % n;
    let points = (0..vertices).map(|_| std::array::from_fn(|_| i128::from(below(size)))).collect();
    let corners = (0..faces).map(|_| std::array::from_fn(|_| below(vertices) as u32)).collect();
    (points, corners)
}

#[test]
fn pairs_equal_the_exact_oracle_on_a_thousand_pairs_of_small_meshes() {
    let mut random = SplitMix::new(2024);
    let (mut strangers, mut own, mut neighbours) = (0, 0, 0);
    for round in 0..1000u64 {
        let size = 2 + round % 6;
        let (p, f) = random_mesh(&mut random, 8, 10, size);
        let (q, g) = random_mesh(&mut random, 7, 9, size);
        let corners = |points: &[Point], face: &[u32; 3]| face.map(|v| points[v as usize]);
        let mut expected = Vec::new();
        for (i, fa) in (0u32..).zip(&f) {
            for (j, fb) in (0u32..).zip(&g) {
                if grid_oracle::triangles_intersect(&corners(&p, fa), &corners(&q, fb)) {
                    expected.push((i, j));
                }
            }
        }
        let (a, b) = (as_floats(&p), as_floats(&q));
        assert_eq!(triangle_pairs(&a, &f, &b, &g), expected, "round {round}");
        assert_eq!(
            TriangleTree::new(&a, &f).pairs_with(&TriangleTree::new(&b, &g)),
            expected,
            "round {round}"
        );
        strangers += expected.len();

        let mut expected = Vec::new();
        for (i, fa) in (0u32..).zip(&f) {
            for (j, fb) in (0u32..).zip(&f).skip(i as usize + 1) {
                if oracle_neighbours(&p, [*fa, *fb]) {
                    expected.push((i, j));
                    neighbours += usize::from(fa.iter().any(|v| fb.contains(v)));
                }
            }
        }
        assert_eq!(self_triangle_pairs(&a, &f), expected, "round {round}");
        own += expected.len();
    }
    assert!(strangers > 5000 && own > 2000 && neighbours > 1000, "{strangers} {own} {neighbours}");
}

#[test]
fn signs_far_below_rounding_are_right() {
    // Coordinates near 2^20, triangles that touch or miss by one unit: products of 2^60 leave no room for a plain f64.
    let mut random = SplitMix::new(5);
    let mut hits = 0;
    for _ in 0..3000 {
        let mut point = || -> Point { std::array::from_fn(|_| i128::from(random.next_u64() % (1 << 20))) };
        // Even coordinates, so that the middle of an edge is an integer; it is moved by at most one unit.
        let a = [point(), point(), point()].map(|p| p.map(|x| 2 * (x / 2)));
        let middle: Point = std::array::from_fn(|k| (a[0][k] + a[1][k]) / 2);
        let (q, r) = (point(), point());
        let moved: Point = std::array::from_fn(|k| middle[k] + i128::from(random.next_u64() % 3) - 1);
        let b = [moved, q, r];
        let floats = |t: [Point; 3]| t.map(|p| p.map(|x| x as f64));
        let expected = grid_oracle::triangles_intersect(&a, &b);
        assert_eq!(triangles_intersect(&floats(a), &floats(b)), expected);
        assert_eq!(triangles_intersect(&floats(b), &floats(a)), expected);
        hits += usize::from(expected);
    }
    assert!((300..2900).contains(&hits), "{hits}");
}

#[test]
fn faces_that_are_no_triangle_take_part_in_nothing() {
    let positions = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 0.5, 0.0],
        [0.0, 0.0, 0.0],
        [f64::NAN, 0.0, 0.0],
    ];
    let faces = [[0, 1, 2], [1, 3, 2], [0, 4, 1], [0, 0, 1], [0, 1, 5], [0, 1, 99], [0, 1, 2]];
    let tree = TriangleTree::new(&positions, &faces);
    assert_eq!(tree.skipped(), 5);
    assert_eq!(tree.self_pairs(), [(0, 6)]);
    assert_eq!(tree.pairs_with(&tree), [(0, 0), (0, 6), (6, 0), (6, 6)]);
    let empty = TriangleTree::new(&[], &[]);
    assert!(empty.pairs_with(&tree).is_empty() && tree.pairs_with(&empty).is_empty());
    assert!(empty.self_pairs().is_empty());
    assert!(!mesh_triangles_intersect(&positions, [0, 1, 99], [0, 1, 2]));
    assert!(triangle_pairs(&[], &[], &positions, &faces).is_empty());
    let single = TriangleTree::new(&positions, &faces[..1]);
    assert!(single.self_pairs().is_empty());
    assert_eq!(single.pairs_with(&tree), [(0, 0), (0, 6)]);
    assert_eq!(single.pairs_with(&single), [(0, 0)]);
    assert_eq!(triangle_pairs(&positions, &faces, &positions, &faces[..1]), [(0, 0), (6, 0)]);
}

#[test]
fn the_segment_of_two_triangles_is_where_they_intersect() {
    let a = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let b = [[1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, 5.0, 0.0]];
    let [mut p, mut q] = intersection_segment(&a, &b).unwrap();
    if p[1] > q[1] {
        std::mem::swap(&mut p, &mut q);
    }
    assert_eq!((p, q), ([1.0, 1.0, 0.0], [1.0, 3.0, 0.0]));
    // One common point, one plane, nothing.
    assert_eq!(intersection_segment(&a, &[[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [2.0, 1.0, 1.0]]), None);
    assert_eq!(intersection_segment(&a, &a), None);
    assert_eq!(intersection_segment(&a, &a.map(|p| [p[0], p[1], 1.0])), None);
}

fn tree(mesh: &TriMesh) -> TriangleTree<'_> {
    TriangleTree::new(mesh.positions(), mesh.faces())
}

/// A tube about the origin, slightly turned so that no two meshes share a symmetry.
fn sleeve(radius: f64, turn: f64) -> TriMesh {
    mapped(&tube(radius, 1.0, 60, 24), |p| {
        let (sin, cos) = turn.sin_cos();
        [cos * p[0] - sin * p[2], p[1] - 0.5, sin * p[0] + cos * p[2]]
    })
}

#[test]
fn two_tubes_around_a_ball_intersect_it_in_two_circles_each() {
    let (ball, inner, outer) = (icosphere(0.4, 4), sleeve(0.3, 0.1), sleeve(0.32, 0.2));
    let ball_tree = tree(&ball);
    for (mesh, radius) in [(&inner, 0.3), (&outer, 0.32)] {
        let pairs = tree(mesh).pairs_with(&ball_tree);
        let expected: Vec<(u32, u32)> = (0..mesh.face_count())
            .flat_map(|i| (0..ball.face_count()).map(move |j| (i, j)))
            .filter(|&(i, j)| triangles_intersect(&mesh.corners(i), &ball.corners(j)))
            .map(|(i, j)| (i as u32, j as u32))
            .collect();
        assert_eq!(pairs, expected);
        let found = contours(&tree(mesh), &ball_tree, &pairs);
        assert_eq!(found.len(), 2);
        for contour in &found {
            assert!(contour.closed);
            let circle = std::f64::consts::TAU * radius;
            assert!((contour.length / circle - 1.0).abs() < 0.01, "{} {circle}", contour.length);
        }
    }
    let report = report(&ball, &[&inner, &outer]);
    assert!(report.garments.iter().all(|g| g.with_body.pairs.len() > 100 && g.depths.len() > 100));
    assert!(report.garments.iter().all(|g| g.with_itself == TrianglePairs::default()));
    let [layer] = &report.layers[..] else { panic!("one pair of layers: {:?}", report.layers) };
    assert_eq!((layer.inner, layer.outer, &layer.pairs), (0, 1, &TrianglePairs::default()));
    assert_eq!((layer.counted, layer.order().violations), (outer.vertex_count(), 0));
    assert_eq!(report.body_itself, Intersections::default());
    let circles = std::f64::consts::TAU * 1.24;
    assert!((report.intersections().contour_length / circles - 1.0).abs() < 0.01);
    let far = mapped(&ball, |p| [p[0] + 5.0, p[1], p[2]]);
    let apart = self::report(&far, &[&outer, &inner]);
    assert_eq!((apart.intersections().pairs, apart.penetration(0.0).inside), (0, 0));
    assert_eq!(apart.order().share(), 1.0);
}

fn report(body: &TriMesh, garments: &[&TriMesh]) -> Report {
    let garments: Vec<ReportGarment<'_>> =
        garments.iter().map(|g| ReportGarment { positions: g.positions(), faces: g.faces() }).collect();
    let order = LayerOrder::NearestVertex;
    let selection = Selection { layers: &[(0, 1)], order, triangles: true, body_itself: true };
    Report::count(&CountedBody::new(&Surface::from_mesh(body), Distance::ClosestPoint), &garments, &selection)
}

#[test]
fn points_inside_a_sphere_are_counted_with_their_depth() {
    let sphere = icosphere(1.0, 4);
    let points = [[0.0, 0.0, 0.0], [0.0, 0.9, 0.0], [1.5, 0.0, 0.0], [0.0, 0.0, -0.995]];
    let garment = ReportGarment { positions: &points, faces: &[[0, 1, 2]] };
    let order = LayerOrder::NearestVertex;
    let selection = Selection { layers: &[], order, triangles: false, body_itself: false };
    let surface = Surface::from_mesh(&sphere);
    let report = Report::count(&CountedBody::new(&surface, Distance::ClosestPoint), &[garment], &selection);
    let p = report.penetration(0.05);
    assert_eq!((p.vertices, p.inside, p.deep), (4, 3, 2));
    assert!((p.max_depth - 1.0).abs() < 0.01, "{p:?}");
}

#[test]
fn contours_survive_aligned_meshes() {
    // Every contour runs along edges and through vertices of both grids.
    let flat = grid(1.0, 1.0, 8, 8);
    let upright = mapped(&grid(1.0, 1.0, 8, 8), |p| [p[0], 0.5, p[1] - 0.5]);
    let pairs = tree(&flat).pairs_with(&tree(&upright));
    let found = contours(&tree(&flat), &tree(&upright), &pairs);
    assert_eq!(found.len(), 1);
    assert!(!found[0].closed && (found[0].length - 1.0).abs() < 1e-12, "{}", found[0].length);
}

#[test]
fn a_mesh_through_itself_is_found_and_a_smooth_one_is_not() {
    let wavy = mapped(&irregular_grid(1.0, 1.0, 20, 20, 0.3, 1), |p| [p[0], p[1], 0.1 * (9.0 * p[0]).sin()]);
    assert!(tree(&wavy).self_pairs().is_empty());
    let balls = [icosphere(0.5, 3), mapped(&icosphere(0.5, 3), |p| [p[0] + 0.51, p[1] + 0.02, p[2] - 0.03])];
    let both = union(&[&balls[0], &balls[1]]);
    let pairs = tree(&both).self_pairs();
    assert_eq!(pairs.len(), tree(&balls[0]).pairs_with(&tree(&balls[1])).len());
    let found = self_contours(&tree(&both), &pairs);
    assert_eq!(found.len(), 1);
    let apart: f64 = 0.51f64.powi(2) + 0.02f64.powi(2) + 0.03f64.powi(2);
    let circle = std::f64::consts::TAU * (0.25 - apart / 4.0).sqrt();
    assert!(found[0].closed && (found[0].length / circle - 1.0).abs() < 0.02);
}

#[test]
fn threads_change_nothing() {
    let (ball, garment) = (icosphere(0.4, 4), sleeve(0.39, 0.1));
    let [one, many] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tree(&garment).pairs_with(&tree(&ball)))
    });
    assert_eq!(one, many);
}

/// A tree that is kept while the mesh moves finds what a new one finds, also when faces lose their area or get one.
#[test]
fn a_refitted_tree_finds_the_same_pairs() {
    let mesh = irregular_grid(0.5, 0.5, 12, 12, 0.25, 4);
    let ball = icosphere(0.15, 3);
    let ball = TriangleTree::new(ball.positions(), ball.faces());
    let mut random = SplitMix::new(5);
    let (mut positions, faces) = (mesh.positions().to_vec(), mesh.faces());
    let mut kept = TriangleTree::new(&positions, faces).into_kept();
    let mut found = 0;
    for round in 0..12 {
        let size = 0.02 * f64::from(round);
        positions.iter_mut().flatten().for_each(|x| *x += size * random.symmetric());
        if round % 4 == 2 {
            let [a, b, _] = faces[7];
            positions[a as usize] = positions[b as usize];
        }
        let (fresh, refitted) =
            (TriangleTree::new(&positions, faces), TriangleTree::refitted(kept, &positions, faces));
        assert_eq!(refitted.skipped(), fresh.skipped());
        assert_eq!(refitted.self_pairs(), fresh.self_pairs());
        assert_eq!(refitted.pairs_with(&ball), fresh.pairs_with(&ball));
        found += fresh.self_pairs().len().min(fresh.pairs_with(&ball).len());
        kept = refitted.into_kept();
    }
    assert!(found > 100, "{found}");
}
