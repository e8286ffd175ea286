use super::*;
use crate::config::parse;
use crate::dataset::Preprocessor;
use clothcombo_data::asset::{Binding, Category, Garment, Pose};
use clothcombo_data::generate::mannequin;
use clothcombo_physics::energy::Term;
use clothcombo_physics::mesh::shapes::grid;
use std::path::Path;

/// A patch of cloth whose lowest corner has the height `low` (m).
fn patch(preprocessor: &Preprocessor, joints: &ActiveJoints, low: f64) -> Arc<PreparedGarment> {
    let flat = grid(0.2, 0.2, 4, 4);
    let positions = flat.positions().iter().map(|[x, y, z]| [*x, y + low, z + 0.15]).collect();
    let rest = flat.with_positions(positions).unwrap();
    let (name, category) = (format!("patch at {low}"), Category::Top);
    let garment = Garment { name, ..Garment::new(category, rest) };
    let binding = Binding::new(&garment, &preprocessor.body, &preprocessor.binding);
    Arc::new(preprocessor.finish(garment, binding, joints).unwrap())
}

#[test]
fn distant_garments_are_a_pair_in_the_full_graph_only() {
    let losses = LossesConfig::default();
    let body = Arc::new(mannequin());
    let text = "seed = 0\n[[data.garments]]\ngenerate = { count = 2, seed = 0 }\n[[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 1\n";
    let config = parse(text, Path::new("patches.toml"), &[]).unwrap();
    let preprocessor = Preprocessor::new(&config, body.clone());
    let joints = ActiveJoints::named(&body, &body.joint_names).unwrap();
    // The second one begins 4 cm above the first; the third is 25 cm above that.
    let garments = [0.0, 0.24, 0.69].map(|low| patch(&preprocessor, &joints, low)).to_vec();
    let pairs = |graph| {
        let builder = SceneBuilder {
            body: &body,
            joints: &joints,
            encoding: PoseEncoding::RotationMatrix,
            losses: &losses,
            graph,
            layer_thickness: None,
        };
        let bodies = vec![BodySample { shape: Vec::new(), pose: Pose::t_pose(body.joint_count()) }];
        let sample = SceneSample { garments: vec![0, 1, 2], bodies, below: Vec::new(), repulsion_sample: 0 };
        let scene = builder.build(sample, &builder.arrange(garments.clone(), &[]), 1.0);
        let layers = &scene.bodies[0].energy.layers;
        assert!(layers.iter().all(|layer| layer.weights[Term::LayerCollision] > 0.0));
        assert_eq!(scene.contacts, layers.iter().map(|layer| (layer.inner, layer.outer)).collect::<Vec<_>>());
        scene.contacts
    };
    assert_eq!(pairs(Graph::Near), [(0, 1)]);
    assert_eq!(pairs(Graph::Full), [(0, 1), (0, 2), (1, 2)]);
}
