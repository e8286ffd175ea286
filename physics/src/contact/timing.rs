//! Times of intersections on one thread, printed on request.

use super::*;
use crate::mesh::TriMesh;
use crate::mesh::shapes::{mapped, tube};

fn tree(mesh: &TriMesh) -> TriangleTree<'_> {
    TriangleTree::new(mesh.positions(), mesh.faces())
}

/// `cargo test --release -p clothcombo-physics contact::timing -- --ignored --nocapture`
#[test]
#[ignore = "prints times"]
fn timing_of_a_garment_over_a_body() {
    let body = mapped(&tube(0.3, 1.0, 150, 90), |p| [p[0], p[1], 0.7 * p[2]]);
    let garment = mapped(&tube(0.3, 1.0, 158, 79), |p| {
        let wave = 1.01 + 0.02 * (12.0 * p[1]).sin() * (7.0 * p[0].atan2(p[2])).sin();
        [wave * p[0], p[1] + 0.003, 0.7 * wave * p[2]]
    });
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let timed = |name: &str, f: &(dyn Fn() -> usize + Sync)| {
        let mut best = f64::INFINITY;
        let mut count = 0;
        for _ in 0..9 {
            let start = std::time::Instant::now();
            count = pool.install(f);
            best = best.min(start.elapsed().as_secs_f64());
        }
        println!("{name}: {count} in {:.2} ms", 1e3 * best);
    };
    println!("{} garment and {} body triangles, one thread", garment.face_count(), body.face_count());
    let trees = (tree(&garment), tree(&body));
    let pairs = trees.0.pairs_with(&trees.1);
    timed("tree of the garment", &|| tree(&garment).skipped());
    timed("pairs, trees built", &|| trees.0.pairs_with(&trees.1).len());
    let pairs_of = |garment: &TriMesh| {
        triangle_pairs(garment.positions(), garment.faces(), body.positions(), body.faces()).len()
    };
    timed("pairs from plain arrays", &|| pairs_of(&garment));
    let short = mapped(&garment, |p| [p[0], 0.5 * p[1], p[2]]);
    timed("the same over half of the body", &|| pairs_of(&short));
    timed("candidates only", &|| trees.0.candidate_count(&trees.1));
    timed("self pairs of the garment", &|| trees.0.self_pairs().len());
    timed("self pairs of the body", &|| trees.1.self_pairs().len());
    timed("contours", &|| contours(&trees.0, &trees.1, &pairs).len());
}
