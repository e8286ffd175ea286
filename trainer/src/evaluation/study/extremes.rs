//! Stability: bodies, poses and stacks far outside of what was trained on, through networks and post-process.

use super::subject::Subject;
use super::table::{Table, number, percent};
use crate::dataset::{BodySample, HeldOut, PreparedScene, SceneSample};
use crate::evaluation::certificates::{Dressing, OutfitResult};
use crate::evaluation::hard_poses;
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::DrapeError;
use crate::run::spread::Spread;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_data::asset::Pose;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::energy::Term;
use miette::Report;
use serde::Serialize;

/// What happened to the scenes of one case.
#[derive(Clone, Debug, Serialize)]
pub struct Extreme {
    /// What is extreme.
    pub case: String,
    /// Number of scenes.
    pub scenes: usize,
    /// Scenes with a position that is not finite.
    pub not_finite: usize,
    /// Scenes the post-process refused, with the reason of one of them.
    pub refused: usize,
    /// See `refused`.
    pub reason: Option<String>,
    /// Strain of the networks' drape over that of skinning, median over the scenes.
    pub strain_ratio: f64,
    /// Farthest any vertex is from where skinning puts it [mm].
    pub farthest_mm: f64,
    /// Share of scenes without a pair with the body or between garments after the post-process.
    pub clear: f64,
    /// Deepest vertex after the post-process [mm], median over the scenes.
    pub depth_mm: f64,
}

struct Case {
    name: String,
    layers: usize,
    shape: Option<f64>,
    pose: Option<Pose>,
}

fn cases() -> Vec<Case> {
    let poses = hard_poses().into_iter();
    let mut cases: Vec<Case> = poses
        .map(|(name, pose)| Case { name: name.into(), layers: 1, shape: None, pose: Some(pose) })
        .collect();
    for beta in [-5.0, 5.0] {
        cases.push(Case {
            name: format!("all shapes at β = {beta:+}"),
            layers: 1,
            shape: Some(beta),
            pose: None,
        });
    }
    cases.push(Case { name: "12 layers".into(), layers: 12, shape: None, pose: None });
    cases
}

/// Number of cases.
pub fn case_count() -> usize {
    cases().len()
}

/// What came of one scene.
enum Outcome {
    NotFinite,
    /// By the networks, with the reason.
    Refused(String),
    Draped {
        /// Strain over that of skinning.
        strain_ratio: f64,
        /// Farthest any vertex is from where skinning puts it [mm].
        farthest_mm: f64,
        /// Whether nothing crosses after the post-process, and the deepest vertex then [mm]; or why it was refused.
        resolved: Result<(bool, f64), String>,
    },
}

/// Drapes `scenes` scenes of every case.
///
/// # Errors
/// When a garment cannot be read.
pub fn ask(
    subject: &Subject,
    question: usize,
    scenes: usize,
    settings: &ResolveSettings,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Extreme>, Report> {
    let cases = cases();
    let all: Vec<usize> = (0..subject.dataset.garments.len()).collect();
    let networks = subject.networks();
    let dressing = Dressing::new(&subject.dataset, &subject.config.losses, Some(&networks));
    let measured = |(case, index): (usize, usize)| {
        let draw = subject.draw([question, 1000 * case + index], &all, cases[case].layers, HeldOut::Windows);
        let scene = subject.prepare(cases[case].applied_to(draw))?;
        let outcome = measure(&networks, &dressing, &scene, index, settings);
        done();
        outcome
    };
    // Those with the most layers, which take longest, come last and are begun first.
    let items = (0..cases.len()).flat_map(|case| (0..scenes).map(move |index| (case, index))).rev();
    let mut outcomes = map_single_threaded(items.collect(), None, measured)?;
    let of_case = |case: Case| Extreme::of(case.name, outcomes.split_off(outcomes.len() - scenes));
    Ok(cases.into_iter().map(of_case).collect())
}

impl Case {
    /// `draw` with what is extreme.
    fn applied_to(&self, draw: SceneSample) -> SceneSample {
        let body = &draw.bodies[0];
        let body = BodySample {
            shape: body.shape.iter().map(|b| self.shape.unwrap_or(*b)).collect(),
            pose: self.pose.clone().unwrap_or_else(|| body.pose.clone()),
        };
        SceneSample { bodies: vec![body], ..draw }
    }
}

fn measure(
    networks: &Networks<'_>,
    dressing: &Dressing<'_>,
    scene: &PreparedScene,
    index: usize,
    settings: &ResolveSettings,
) -> Result<Outcome, Report> {
    let draped = match networks.drape(scene) {
        Ok(draped) => draped,
        Err(DrapeError::Dataset(error)) => return Err(error.into()),
        Err(DrapeError::Model(error)) => return Ok(Outcome::Refused(error.to_string())),
    };
    if !draped.posed.as_flattened().iter().all(|v| v.is_finite()) {
        return Ok(Outcome::NotFinite);
    }
    let skinned = networks.skin(scene)?;
    let energy = &scene.bodies[0].energy;
    let strain = |d: &Draped| -> f64 {
        energy.raw(&d.posed, &d.canonical).garments.iter().filter_map(|raw| raw[Term::Strain]).sum()
    };
    let moved = draped
        .posed
        .iter()
        .zip(&skinned.posed)
        .map(|(a, b)| (0..3).map(|axis| f64::from(a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt());
    let result = OutfitResult::new(index, &dressing.of(scene, &draped.posed), settings);
    Ok(Outcome::Draped {
        strain_ratio: strain(&draped) / strain(&skinned),
        farthest_mm: moved.map(|m| 1e3 * m).fold(0.0, f64::max),
        resolved: match result {
            Ok((result, _)) => Ok((result.after.is_clear(), result.after.max_depth_mm)),
            Err(error) => Err(error.to_string()),
        },
    })
}

impl Extreme {
    fn of(case: String, outcomes: Vec<Outcome>) -> Self {
        let scenes = outcomes.len();
        let (mut not_finite, mut refused, mut reason, mut clear) = (0, 0, None, 0);
        let (mut ratios, mut depths, mut farthest) = (Vec::new(), Vec::new(), 0.0);
        for outcome in outcomes {
            match outcome {
                Outcome::NotFinite => not_finite += 1,
                Outcome::Refused(why) => (refused, reason) = (refused + 1, Some(why)),
                Outcome::Draped { strain_ratio, farthest_mm, resolved } => {
                    ratios.push(strain_ratio);
                    farthest = f64::max(farthest, farthest_mm);
                    match resolved {
                        Err(why) => (refused, reason) = (refused + 1, Some(why)),
                        Ok((is_clear, depth_mm)) => {
                            clear += usize::from(is_clear);
                            depths.push(depth_mm);
                        }
                    }
                }
            }
        }
        // Not a number where nothing came of a case: none is no good result.
        let median = |values: Vec<f64>| if values.is_empty() { f64::NAN } else { Spread::of(values).median };
        Self {
            case,
            scenes,
            not_finite,
            refused,
            reason,
            strain_ratio: median(ratios),
            farthest_mm: farthest,
            clear: clear as f64 / scenes as f64,
            depth_mm: median(depths),
        }
    }
}

/// As a table.
pub fn table(extremes: &[Extreme]) -> Table {
    let mut table = Table::new(
        "Stability: far outside of what was trained on",
        &[
            "case",
            "scenes",
            "not finite",
            "refused",
            "strain over LBS, median",
            "farthest from LBS [mm]",
            "clear after the post-process [%]",
            "deepest after it [mm], median",
        ],
    )
    .with_note("7 and 8 layers, never trained either, are in Table 3.");
    for e in extremes {
        let refused = match &e.reason {
            Some(reason) => format!("{} ({reason})", e.refused),
            None => e.refused.to_string(),
        };
        table.rows.push(vec![
            e.case.clone(),
            e.scenes.to_string(),
            e.not_finite.to_string(),
            refused,
            number(e.strain_ratio),
            number(e.farthest_mm),
            percent(e.clear),
            number(e.depth_mm),
        ]);
    }
    table
}
