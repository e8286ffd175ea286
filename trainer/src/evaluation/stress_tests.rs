//! Stress tests: bodies, poses and stacks far outside of the training data, through networks and post-process.

use super::{Evaluator, Section, Table, drape_by};
use crate::dataset::{BodySample, PreparedScene, SceneSample};
use crate::inference::Draped;
use crate::inference::tensor_store::DrapeError;
use crate::run::report::table::{Column, number, percent, plain};
use crate::run::spread::Spread;
use crate::run::validation::Method;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_data::asset::Pose;
use clothcombo_data::generate::pose::folded_poses;
use clothcombo_physics::contact::resolve::Resolved;
use clothcombo_physics::energy::Term;
use miette::Report;
use serde_json::{Value, json};

struct Case {
    name: String,
    layers: usize,
    shape: Option<f64>,
    pose: Option<Pose>,
}

fn cases() -> Vec<Case> {
    let case = |name: String| Case { name, layers: 1, shape: None, pose: None };
    let poses =
        folded_poses().into_iter().map(|(name, pose)| Case { pose: Some(pose), ..case(name.to_owned()) });
    let shapes =
        [-5.0, 5.0].map(|beta| Case { shape: Some(beta), ..case(format!("all shapes at β = {beta:+}")) });
    let layers = [Case { layers: 12, ..case("12 layers".to_owned()) }];
    poses.chain(shapes).chain(layers).collect()
}

pub fn scene_count(evaluator: &Evaluator<'_>) -> usize {
    cases().len() * evaluator.counts.stress_tests
}

/// What came of one scene.
#[derive(Default)]
struct Outcome {
    is_not_finite: bool,
    /// Why networks or post-process refused it.
    refused: Option<String>,
    /// Strain of the networks' drape over that of LBS + shape transfer.
    strain_ratio: Option<f64>,
    /// Farthest any vertex is from where LBS + shape transfer puts it (mm).
    farthest_mm: Option<f64>,
    /// Whether nothing intersects after the post-process, and the deepest vertex then (mm).
    resolved: Option<(bool, f64)>,
}

/// The scenes of every case.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let Evaluator { model, counts, .. } = evaluator;
    let (cases, scenes) = (cases(), counts.stress_tests);
    let outcome = |(case, index): (usize, usize)| {
        let sample = model.sample_outfit([8, 1000 * case + index], cases[case].layers);
        let outcome = outcome(evaluator, &model.prepare(&cases[case].applied_to(sample))?)?;
        evaluator.scene_done();
        Ok(outcome)
    };
    // Those with the most layers, which take longest, come last and are begun first.
    let items = (0..cases.len()).flat_map(|case| (0..scenes).map(move |index| (case, index))).rev();
    let mut outcomes = map_single_threaded(items.collect(), outcome)?;
    let of_case = |case: Case| statistics(&case.name, &outcomes.split_off(outcomes.len() - scenes));
    let tests: Vec<Value> = cases.into_iter().map(of_case).collect();
    let columns: [Column<'_>; 9] = [
        ("case", "/case", plain),
        ("scenes", "/scenes", plain),
        ("not finite", "/not_finite", plain),
        ("refused", "/refused", plain),
        ("reason", "/reason", plain),
        ("strain over LBS + shape transfer, median", "/strain_ratio", number),
        ("farthest from LBS + shape transfer [mm]", "/farthest_mm", number),
        ("intersection-free after the post-process [%]", "/intersection_free", percent),
        ("deepest after it [mm], median", "/depth_mm", number),
    ];
    let table = Table::new("Stress tests: far outside of the training data", &tests, &columns)
        .with_note("Table 3 has 7 and 8 layers, which training has not either.");
    Ok(vec![Section::new("stress_tests", "Stress tests", "", tests, vec![table])])
}

impl Case {
    /// `sample` with the shape and pose of the case.
    fn applied_to(&self, sample: SceneSample) -> SceneSample {
        let body = &sample.bodies[0];
        let body = BodySample {
            shape: body.shape.iter().map(|b| self.shape.unwrap_or(*b)).collect(),
            pose: self.pose.clone().unwrap_or_else(|| body.pose.clone()),
        };
        SceneSample { bodies: vec![body], ..sample }
    }
}

fn outcome(evaluator: &Evaluator<'_>, scene: &PreparedScene) -> Result<Outcome, Report> {
    let draped = match evaluator.networks.drape(scene) {
        Ok(draped) => draped,
        Err(DrapeError::Dataset(error)) => return Err(error.into()),
        Err(DrapeError::Model(error)) => {
            return Ok(Outcome { refused: Some(error.to_string()), ..Outcome::default() });
        }
    };
    if !draped.posed.as_flattened().iter().all(|v| v.is_finite()) {
        return Ok(Outcome { is_not_finite: true, ..Outcome::default() });
    }
    let skinned = &drape_by(evaluator.networks, &[Method::LbsWithShapeTransfer], scene)?[0];
    let energy = &scene.bodies[0].energy;
    let strain = |d: &Draped| -> f64 {
        energy.raw(&d.posed, &d.canonical).garments.iter().filter_map(|raw| raw[Term::Strain]).sum()
    };
    let vertices = draped.posed.iter().zip(&skinned.posed);
    let moved =
        vertices.map(|(a, b)| (0..3).map(|axis| f64::from(a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt());
    let outcome = Outcome {
        strain_ratio: Some(strain(&draped) / strain(skinned)),
        farthest_mm: Some(moved.map(|m| 1e3 * m).fold(0.0, f64::max)),
        ..Outcome::default()
    };
    let before = evaluator.post_process.of(scene, &draped.posed);
    Ok(match before.resolved(&evaluator.settings) {
        Ok(Resolved { certificate, .. }) => {
            Outcome { resolved: Some((certificate.is_clear(), certificate.max_depth_mm)), ..outcome }
        }
        Err(error) => Outcome { refused: Some(error.to_string()), ..outcome },
    })
}

fn statistics(case: &str, outcomes: &[Outcome]) -> Value {
    // Not a number where nothing came of a case: none is no good result.
    let median = |value: fn(&Outcome) -> Option<f64>| match outcomes.iter().filter_map(value).collect() {
        values if Vec::is_empty(&values) => f64::NAN,
        values => Spread::of(values).median,
    };
    let count = |holds: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| holds(outcome)).count();
    let intersection_free = count(|o| o.resolved.is_some_and(|(is_free, _)| is_free));
    json!({
        "case": case,
        "scenes": outcomes.len(),
        "not_finite": count(|o| o.is_not_finite),
        "refused": count(|o| o.refused.is_some()),
        // Of one of them.
        "reason": outcomes.iter().rev().find_map(|o| o.refused.as_ref()),
        "strain_ratio": median(|o| o.strain_ratio),
        "farthest_mm": outcomes.iter().filter_map(|o| o.farthest_mm).fold(0.0, f64::max),
        "intersection_free": intersection_free as f64 / outcomes.len() as f64,
        "depth_mm": median(|o| o.resolved.map(|(_, depth_mm)| depth_mm)),
    })
}
