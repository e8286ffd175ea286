//! Errors over all scenes, as tables and as JSON.

use crate::cli::table::{Cell, row, table};
use crate::evaluation::equilibrium_error::{MethodError, SceneError, SolverRun, TermEnergies, converged};
use crate::run::spread::Spread;
use clothcombo_physics::equilibrium::SolverSettings;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// All scenes together.
#[derive(Serialize)]
pub(super) struct Summary {
    tolerance: f64,
    iterations: usize,
    scenes: Vec<SceneError>,
    methods: Vec<MethodSummary>,
    reference_terms: TermEnergies,
    /// In how many scenes the networks end above skinning; none without networks.
    above_skinning: Option<usize>,
    solver: SolverSummary,
    /// Innermost first; none for single garments.
    strain_ratios: Vec<StrainRatio>,
}

#[derive(Serialize)]
struct MethodSummary {
    method: String,
    excess: Spread,
    excess_percent: Spread,
    distance_mm: Spread,
    terms: TermEnergies,
}

/// The runs that made the references.
#[derive(Serialize)]
struct SolverSummary {
    converged: usize,
    /// How often each reason ended a run.
    stops: BTreeMap<&'static str, usize>,
    minima_differ: usize,
    iterations: Spread,
    seconds: Spread,
    relative_gradient: Spread,
}

/// Strain of a layer in the outfit over that of the single garment, medians over the scenes.
#[derive(Serialize)]
struct StrainRatio {
    /// In equilibrium.
    equilibrium: f64,
    /// Of the networks' drapes.
    network: Option<f64>,
}

impl Summary {
    pub(super) fn new(scenes: Vec<SceneError>, settings: &SolverSettings) -> Self {
        // The methods are the same in every scene.
        let method_count = scenes.first().map_or(0, |scene| scene.methods.len());
        let above: Option<Vec<bool>> = scenes.iter().map(SceneError::is_above_skinning).collect();
        let above = above.filter(|above| !above.is_empty());
        Self {
            tolerance: settings.tolerance,
            iterations: settings.iterations,
            methods: (0..method_count).map(|i| MethodSummary::new(&scenes, i)).collect(),
            reference_terms: mean_terms(scenes.iter().map(|scene| &scene.reference_run().terms)),
            above_skinning: above.map(|above| above.into_iter().filter(|above| *above).count()),
            solver: SolverSummary::new(&scenes),
            strain_ratios: strain_ratios(&scenes),
            scenes,
        }
    }

    pub(super) fn tables(&self) -> String {
        let (count, solver) = (self.scenes.len(), &self.solver);
        let stops: Vec<String> = solver.stops.iter().map(|(name, count)| format!("{count} {name}")).collect();
        let mut text = format!(
            "{}\n{}\nsolver: {} steps, {} s\nconverged (relative gradient ≤ {:e}): {} of {count}; stops: {}\n",
            self.scene_table(),
            self.method_table(),
            solver.iterations.text(),
            solver.seconds.text(),
            self.tolerance,
            solver.converged,
            stops.join(", ")
        );
        if self.methods.len() > 2 {
            text += &format!("starts that end in different minima: {} of {count}\n", solver.minima_differ);
        }
        if let Some(above) = self.above_skinning {
            text += &format!("networks above skinning: {above} of {count}\n");
        }
        text += &format!("\nmean of every energy, weighted [J]\n{}", self.term_table());
        if !self.strain_ratios.is_empty() {
            let row = |(layer, ratio): (usize, &StrainRatio)| {
                let StrainRatio { equilibrium, network } = ratio;
                row!["layer" => layer + 1, "equilibrium" => *equilibrium, "network" => *network]
            };
            let rows: Vec<_> = self.strain_ratios.iter().enumerate().map(row).collect();
            text += "\nstrain in the outfit over that of the single garment, medians\n";
            text += &table(&rows);
        }
        text
    }

    fn scene_table(&self) -> String {
        let row = |scene: &SceneError| {
            let run = scene.reference_run();
            let mut row = row! {
                "scene" => scene.scene,
                "garments" => scene.garments.join(", "),
                "vertices" => scene.vertices,
                "minimum J" => run.energy,
            };
            row.extend(scene.methods.iter().flat_map(|m| {
                row![format!("{} +J", m.method) => m.error.excess, "%" => m.error.excess_percent, "mm" => m.error.distance_mm]
            }));
            row.extend(row! {
                "steps" => run.iterations,
                "seconds" => run.seconds,
                "rel. grad" => run.relative_gradient,
                "stop" => run.stop,
                "lowest from" => run.start,
                "" => if scene.minima_differ { "minima differ" } else { "" },
            });
            row
        };
        table(&self.scenes.iter().map(row).collect::<Vec<_>>())
    }

    fn method_table(&self) -> String {
        let method = |m: &MethodSummary| {
            row! {
                "mean / median / 95 %" => m.method,
                "excess [J]" => m.excess,
                "excess [% of LBS + shape transfer]" => m.excess_percent,
                "distance [mm]" => m.distance_mm,
            }
        };
        table(&self.methods.iter().map(method).collect::<Vec<_>>())
    }

    /// Every term of the energy, method by method.
    fn term_table(&self) -> String {
        let methods = self.methods.iter().map(|m| (m.method.as_str(), &m.terms));
        let energies: Vec<_> = methods.chain([("equilibrium", &self.reference_terms)]).collect();
        let terms: BTreeSet<&str> = energies.iter().flat_map(|(_, terms)| terms.keys().copied()).collect();
        let row = |(name, values): &(&str, &TermEnergies)| {
            let mut row = row!["method" => name];
            for term in &terms {
                row.extend(row![term => values.get(term).copied().unwrap_or(0.0)]);
            }
            row.extend(row!["sum" => values.values().sum::<f64>()]);
            row
        };
        table(&energies.iter().map(row).collect::<Vec<_>>())
    }
}

impl MethodSummary {
    fn new(scenes: &[SceneError], index: usize) -> Self {
        let found = || scenes.iter().map(|scene| &scene.methods[index]);
        let spread = |value: fn(&MethodError) -> f64| Spread::of(found().map(value).collect());
        Self {
            method: scenes[0].methods[index].method.clone(),
            excess: spread(|m| m.error.excess),
            excess_percent: spread(|m| m.error.excess_percent),
            distance_mm: spread(|m| m.error.distance_mm),
            terms: mean_terms(found().map(|m| &m.terms)),
        }
    }
}

impl SolverSummary {
    fn new(scenes: &[SceneError]) -> Self {
        let runs = || scenes.iter().map(SceneError::reference_run);
        let spread = |value: fn(&SolverRun) -> f64| Spread::of(runs().map(value).collect());
        let mut stops = BTreeMap::new();
        runs().for_each(|run| *stops.entry(run.stop).or_default() += 1);
        Self {
            converged: runs().filter(|run| converged(run)).count(),
            stops,
            minima_differ: scenes.iter().filter(|scene| scene.minima_differ).count(),
            iterations: spread(|run| run.iterations as f64),
            seconds: spread(|run| run.seconds),
            relative_gradient: spread(|run| run.relative_gradient),
        }
    }
}

/// Mean of every weighted energy over the scenes (J).
fn mean_terms<'a>(scenes: impl ExactSizeIterator<Item = &'a TermEnergies>) -> TermEnergies {
    let (count, mut means) = (scenes.len() as f64, TermEnergies::new());
    for (term, energy) in scenes.flatten() {
        *means.entry(term).or_default() += energy / count;
    }
    means
}

fn strain_ratios(scenes: &[SceneError]) -> Vec<StrainRatio> {
    let layers = scenes.iter().map(|scene| scene.layers.len()).min().unwrap_or(0);
    let ratio = |layer: usize| {
        let of_layer = || scenes.iter().map(move |scene| &scene.layers[layer]);
        let network: Vec<f64> =
            of_layer().filter_map(|l| l.network.map(|[alone, outfit]| outfit / alone)).collect();
        StrainRatio {
            equilibrium: Spread::of(of_layer().map(|l| l.outfit / l.single_garment).collect()).median,
            network: (!network.is_empty()).then(|| Spread::of(network).median),
        }
    };
    (0..layers).map(ratio).collect()
}
