//! Stability: bodies, poses and stacks far outside of what was trained on, through networks and post-process.

use super::subject::Subject;
use super::table::{Table, number, percent};
use crate::drape::DrapeError;
use crate::evaluate::Spread;
use crate::evaluate::certificates::{Dressing, OutfitResult};
use crate::evaluate::hard_poses;
use crate::scene::{BodyDraw, SceneDraw, Unseen};
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
    /// Scenes the post-process refused, with the reason of the last.
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
    for layers in [8, 12] {
        cases.push(Case { name: format!("{layers} layers"), layers, shape: None, pose: None });
    }
    cases
}

/// Number of cases.
pub fn case_count() -> usize {
    cases().len()
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
    cases()
        .iter()
        .enumerate()
        .map(|(i, case)| measure(subject, [question, 1000 * i], case, scenes, settings, done))
        .collect()
}

fn measure(
    subject: &Subject,
    [question, first]: [usize; 2],
    case: &Case,
    scenes: usize,
    settings: &ResolveSettings,
    done: &(dyn Fn() + Sync),
) -> Result<Extreme, Report> {
    let all: Vec<usize> = (0..subject.library.wardrobe.len()).collect();
    let networks = subject.networks();
    let dressing = Dressing::new(&subject.library, &subject.config.losses, Some(&networks));
    let (mut ratios, mut depths) = (Vec::new(), Vec::new());
    let mut found = Extreme {
        case: case.name.clone(),
        scenes,
        not_finite: 0,
        refused: 0,
        reason: None,
        strain_ratio: f64::NAN,
        farthest_mm: 0.0,
        clear: 0.0,
        depth_mm: f64::NAN,
    };
    for index in 0..scenes {
        let at = [question, first + index];
        let draw = subject.draw(at, &all, case.layers, Unseen::Poses);
        let body = &draw.bodies[0];
        let body = BodyDraw {
            shape: body.shape.iter().map(|b| case.shape.unwrap_or(*b)).collect(),
            pose: case.pose.clone().unwrap_or_else(|| body.pose.clone()),
        };
        let scene = subject.prepare(SceneDraw { bodies: vec![body], ..draw })?;
        done();
        let draped = match networks.drape(&scene) {
            Ok(draped) => draped,
            Err(DrapeError::Library(error)) => return Err(error.into()),
            Err(DrapeError::Model(error)) => {
                found.refused += 1;
                found.reason = Some(error.to_string());
                continue;
            }
        };
        if !draped.posed.as_flattened().iter().all(|v| v.is_finite()) {
            found.not_finite += 1;
            continue;
        }
        let skinned = networks.skin(&scene)?;
        let energy = &scene.bodies[0].energy;
        let strain = |d: &crate::evaluate::Draped| -> f64 {
            energy.raw(&d.posed, &d.canonical).garments.iter().filter_map(|raw| raw[Term::Strain]).sum()
        };
        ratios.push(strain(&draped) / strain(&skinned));
        let moved = draped
            .posed
            .iter()
            .zip(&skinned.posed)
            .map(|(a, b)| (0..3).map(|axis| f64::from(a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt());
        found.farthest_mm = moved.map(|m| 1e3 * m).fold(found.farthest_mm, f64::max);
        let draped = dressing.of(&scene, &draped.posed);
        match OutfitResult::new(index, &draped, settings) {
            Ok((result, _)) => {
                found.clear += f64::from(u8::from(result.after.is_clear())) / scenes as f64;
                depths.push(result.after.max_depth_mm);
            }
            Err(error) => {
                found.refused += 1;
                found.reason = Some(error.to_string());
            }
        }
    }
    // Not a number where nothing came of a case: none is no good result.
    let median = |values: Vec<f64>| if values.is_empty() { f64::NAN } else { Spread::of(values).median };
    (found.strain_ratio, found.depth_mm) = (median(ratios), median(depths));
    Ok(found)
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
    );
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
