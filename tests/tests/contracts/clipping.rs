//! `optimizer.clip`: of every scene before the mean, or of the mean.

use burn::module::{Module, ModuleVisitor, Param};
use burn::tensor::Tensor;
use clothcombo_model::gradient_bucket;
use clothcombo_tests::{Untrained, loss_and_gradient};
use clothcombo_trainer::config::{ClipScope, OptimizerConfig, Trains};
use clothcombo_trainer::dataset::PreparedScene;
use clothcombo_trainer::run::event::StepRecord;
use clothcombo_trainer::training::learner::{Learner, StepInput, StepOutput};

struct Setting {
    run: Untrained,
    scenes: Vec<PreparedScene>,
}

/// A usual scene and one whose garment starts so far from its shape that its gradient is huge.
fn setting(folder: &std::path::Path) -> Setting {
    let run = Untrained::new(folder, &["stages.0.accumulate=2", "optimizer.ema_decay=0.0"]);
    let mut scenes = run.scenes(0);
    for start in scenes[1].bodies.iter_mut().flat_map(|body| &mut body.start) {
        *start = start.map(|x| 4.0 * x);
    }
    Setting { run, scenes }
}

impl Setting {
    fn learner(&self, clip: ClipScope, clip_norm: f64) -> Learner {
        self.run.learner_with(&OptimizerConfig { clip, clip_norm, ..self.run.config.optimizer.clone() })
    }

    fn input<'a>(&'a self, scenes: &'a [PreparedScene]) -> StepInput<'a> {
        StepInput::whole(&self.run.tensors, scenes, Trains::Single)
    }

    /// The gradient that a step on `scenes` takes, before Adam.
    fn gradient(&self, clip: ClipScope, clip_norm: f64, scenes: &[PreparedScene]) -> Vec<f32> {
        loss_and_gradient(self.learner(clip, clip_norm), &self.run.tensors, scenes, Trains::Single).1
    }

    fn stepped(&self, clip: ClipScope, scenes: &[PreparedScene]) -> (StepOutput, Vec<f32>) {
        let mut learner = self.learner(clip, 1.0);
        let output = learner.train_step(&self.input(scenes), 1e-3).unwrap();
        let mut values = Values(Vec::new());
        learner.model().visit(&mut values);
        (output, values.0)
    }
}

struct Values(Vec<f32>);

impl ModuleVisitor for Values {
    fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
        self.0.extend_from_slice(parameter.val().into_data().as_slice::<f32>().unwrap());
    }
}

fn norm(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_huge_scene_does_not_change_the_share_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let setting = setting(folder.path());
    let unclipped =
        |scene: &PreparedScene| setting.gradient(ClipScope::Step, 0.0, std::slice::from_ref(scene));
    let [usual, huge] = [0, 1].map(|i| unclipped(&setting.scenes[i]));
    let clip = 0.5 * norm(&usual);
    assert!(norm(&huge) > 20.0 * norm(&usual), "{} {}", norm(&huge), norm(&usual));

    let mean = setting.gradient(ClipScope::Scene, clip, &setting.scenes);
    let scale = |gradient: &[f32]| (clip / norm(gradient)).min(1.0);
    let expected: Vec<f64> = (usual.iter().zip(&huge))
        .map(|(a, b)| 0.5 * (scale(&usual) * f64::from(*a) + scale(&huge) * f64::from(*b)))
        .collect();
    let largest = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (found, expected) in mean.iter().zip(&expected) {
        assert!((f64::from(*found) - expected).abs() <= 1e-4 * largest, "{found} {expected}");
    }
    assert!(norm(&mean) <= clip * (1.0 + 1e-5));

    // The paper's: the mean as it is, in which the usual scene has no say, until it is clipped as a whole.
    let step = setting.gradient(ClipScope::Step, clip, &setting.scenes);
    for ((found, a), b) in step.iter().zip(&usual).zip(&huge) {
        assert!((found - 0.5 * (a + b)).abs() <= 1e-5 * norm(&huge) as f32, "{found} {a} {b}");
    }
}

/// What the processes of a run do: each computes some of the scenes, and their gradients are summed.
#[test]
fn the_shares_of_processes_add_up_to_the_step_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let setting = setting(folder.path());
    let whole = setting.gradient(ClipScope::Scene, 1.0, &setting.scenes);
    let mut sum = vec![0.0; whole.len()];
    let mut norms = Vec::new();
    for scene in &setting.scenes {
        let mut learner = setting.learner(ClipScope::Scene, 1.0);
        let scenes = std::slice::from_ref(scene);
        let output = learner.forward_backward(&StepInput { total: 2, ..setting.input(scenes) }).unwrap();
        let bucket = gradient_bucket(learner.model(), &output.gradients);
        sum.iter_mut().zip(&bucket).for_each(|(sum, part)| *sum += part);
        norms.push(StepRecord::of(scenes, &output, 2).to_row());
    }
    let largest = whole.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    assert!(whole.iter().zip(&sum).all(|(a, b)| (a - b).abs() <= 1e-5 * largest));
    let norm = setting.stepped(ClipScope::Scene, &setting.scenes).0.gradient_norm;
    let joined = StepRecord::joined(&norms).grad_norm;
    assert!((joined - norm).abs() <= 1e-5 * norm, "{joined} {norm}");
}

#[test]
fn one_scene_is_clipped_alike_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let setting = setting(folder.path());
    for scene in &setting.scenes {
        let [by_scene, by_step] = [ClipScope::Scene, ClipScope::Step]
            .map(|clip| setting.stepped(clip, std::slice::from_ref(scene)));
        assert_eq!(by_scene.0.gradient_norm.to_bits(), by_step.0.gradient_norm.to_bits());
        assert!(by_scene.0.gradient_norm > 1.0 && by_scene.1 == by_step.1);
    }
}

#[test]
fn the_norm_of_a_step_is_that_of_what_is_clipped_and_one_broken_scene_skips_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut setting = setting(folder.path());
    let single: Vec<f64> = (setting.scenes.iter())
        .map(|scene| norm(&setting.gradient(ClipScope::Step, 1.0, std::slice::from_ref(scene))))
        .collect();
    let together = norm(&setting.gradient(ClipScope::Step, 1.0, &setting.scenes));
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-4 * b;
    assert!(near(setting.stepped(ClipScope::Scene, &setting.scenes).0.gradient_norm, single[1]));
    assert!(near(setting.stepped(ClipScope::Step, &setting.scenes).0.gradient_norm, together));

    let before = setting.learner(ClipScope::Scene, 1.0);
    let mut values = Values(Vec::new());
    before.model().visit(&mut values);
    for broken in [0, 1] {
        let vertex = setting.scenes[broken].bodies[0].start[0];
        setting.scenes[broken].bodies[0].start[0][0] = f32::NAN;
        for clip in [ClipScope::Scene, ClipScope::Step] {
            let (output, after) = setting.stepped(clip, &setting.scenes);
            assert!(output.skipped && !output.gradient_norm.is_finite() && after == values.0, "{clip:?}");
        }
        setting.scenes[broken].bodies[0].start[0] = vertex;
    }
}
