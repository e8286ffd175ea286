use super::*;
use clothcombo_data::mesh::bounds;
use std::collections::{HashMap, HashSet};

#[test]
fn objects_repeat_and_do_not_depend_on_their_number() {
    let (few, many) = (objects(3, 5), objects(3, 60));
    for (a, b) in few.iter().zip(&many) {
        assert!(a.name == b.name && a.mesh.positions == b.mesh.positions);
    }
    assert_ne!(objects(4, 1)[0].mesh.positions, few[0].mesh.positions);
}

#[test]
fn there_are_many_kinds_and_each_has_a_name_of_its_own() {
    let names: HashSet<&str> = kinds().iter().map(|kind| kind.name).collect();
    assert!(names.len() >= 24 && names.len() == kinds().len(), "{names:?}");
}

#[test]
fn objects_are_sound_meshes_of_a_sensible_size() {
    for seed in 1..4 {
        for (i, kind) in kinds().iter().enumerate() {
            let mut draw = Draw::new(seed, i as u64);
            let shape = (kind.make)(&mut draw);
            let name = kind.name;
            let triangles = shape.polygons(true);
            assert!((100..=4200).contains(&triangles.len()), "{name}: {} triangles", triangles.len());
            assert!(shape.positions.as_flattened().iter().all(|x| x.is_finite() && x.abs() < 2.0), "{name}");
            let [low, high] = bounds(&shape.positions);
            let extent = (0..3).fold(0.0, |e: f64, k| e.max(high[k] - low[k]));
            assert!((0.05..=3.1).contains(&extent), "{name}: {extent} m");
            // Each edge has one face on each side.
            let mut sides: HashMap<[u32; 2], usize> = HashMap::new();
            for t in &triangles {
                (0..3).for_each(|k| *sides.entry([t[k], t[(k + 1) % 3]]).or_default() += 1);
            }
            assert!(sides.values().all(|count| *count == 1), "{name}");
            let is_closed = sides.keys().all(|[a, b]| sides.contains_key(&[*b, *a]));
            let closed = [
                "ball",
                "closed box",
                "chair",
                "torus",
                "hula hoop",
                "cushion",
                "capsule",
                "figure of capsules",
            ];
            assert_eq!(is_closed, closed.contains(&name), "{name}");
        }
    }
}
