//! What a validation finds, as it stands in `validation.jsonl`: scores of methods over groups of scenes.

use super::checkpoint::BestValidation;
use super::spread::Spread;
use clothcombo_physics::energy::Term;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;

/// What is compared on a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Linear blend skinning of the rest garment, the paper's baseline: nothing learned, body shape ignored.
    Lbs,
    /// Linear blend skinning of the start state, where the networks start unless the configuration has no shape transfer.
    LbsWithShapeTransfer,
    /// The networks on every garment by itself.
    SingleGarments,
    /// All networks.
    Network,
}

impl Method {
    /// Name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lbs => "LBS",
            Self::LbsWithShapeTransfer => "LBS + shape transfer",
            Self::SingleGarments => "single garments",
            Self::Network => "network",
        }
    }

    /// Of the methods of a group in `validation.jsonl`, the skinning that the networks start from: the last baseline.
    pub fn start_of(methods: &[Value]) -> Option<&Value> {
        let is_skinning = |method: &&Value| {
            [Self::Lbs, Self::LbsWithShapeTransfer].iter().any(|skinning| method["method"] == skinning.name())
        };
        methods.iter().rfind(is_skinning)
    }
}

/// `value` as a share of `whole`; none of nothing.
pub(super) fn ratio(value: f64, whole: f64) -> Option<f64> {
    Some(value / whole).filter(|ratio| whole > 0.0 && ratio.is_finite())
}

/// One method over all scenes of a group.
#[derive(Clone, Debug, Serialize)]
pub struct MethodScore {
    /// Name of the method.
    pub method: &'static str,
    /// Weighted sum of all losses.
    pub total: Spread,
    /// Raw energies.
    pub raw: BTreeMap<&'static str, Spread>,
    /// Mean weighted energies.
    pub weighted: BTreeMap<&'static str, f64>,
    /// Share of the garment vertices inside the body.
    pub inside: f64,
    /// Share of the garment vertices deeper than 5 mm.
    pub deeper_than_5mm: f64,
    /// Share of outer vertices that violate the layer order, among those within 5 cm of an inner layer.
    pub order_violations_nearest_vertex: f64,
}

/// All methods over one group of scenes; the baselines come first, the whole network last.
#[derive(Clone, Debug, Serialize)]
pub struct GroupReport {
    /// Name of the group.
    pub group: &'static str,
    /// Number of scenes.
    pub scenes: usize,
    /// Scores per method.
    pub methods: Vec<MethodScore>,
}

/// The result of one validation.
#[derive(Clone, Debug, Serialize)]
pub struct ValidationReport {
    /// Groups of scenes.
    pub groups: Vec<GroupReport>,
}

impl ValidationReport {
    /// As it stands in `validation.jsonl`: the scores after `step` steps, and the best validation so far.
    pub fn line(&self, step: u64, best: Option<BestValidation>) -> Value {
        let best = best.map(|best| json!({ "step": best.step, "score": best.score.0 }));
        json!({ "step": step, "score": self.score(), "best": best, "groups": self.groups })
    }

    /// One number to compare networks by: mean total loss of the whole network, mean over the groups; less is better.
    /// `None` without scenes, or where it is not finite.
    pub fn score(&self) -> Option<f64> {
        let totals: Vec<f64> =
            self.groups.iter().filter_map(|g| Some(g.methods.last()?.total.mean)).collect();
        let score = totals.iter().sum::<f64>() / totals.len() as f64;
        score.is_finite().then_some(score)
    }
}

/// What a table for the terminal shows of a method: headings, widths, cells.
const METHOD_COLUMNS: [(&str, usize, fn(&MethodScore) -> String); 10] = [
    ("total", 10, |m| format!("{:.3}", m.total.mean)),
    ("median", 10, |m| format!("{:.3}", m.total.median)),
    ("strain", 10, |m| format!("{:.3}", m.raw_mean(Term::Strain))),
    ("bending", 10, |m| format!("{:.4}", m.raw_mean(Term::Bending))),
    ("gravity", 10, |m| format!("{:.3}", m.raw_mean(Term::Gravity))),
    ("collision", 12, |m| format!("{:.2e}", m.raw_mean(Term::BodyCollision))),
    ("holding", 10, |m| format!("{:.4}", m.raw_mean(Term::Holding))),
    ("inside %", 10, |m| format!("{:.2}", 100.0 * m.inside)),
    (">5 mm %", 10, |m| format!("{:.2}", 100.0 * m.deeper_than_5mm)),
    ("violations %", 13, |m| format!("{:.2}", 100.0 * m.order_violations_nearest_vertex)),
];

impl MethodScore {
    fn raw_mean(&self, term: Term) -> f64 {
        self.raw[term.name()].mean
    }
}

impl fmt::Display for ValidationReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for group in &self.groups {
            writeln!(f, "{} ({} scenes; energies raw in J, mean per scene)", group.group, group.scenes)?;
            write!(f, "  {:<21}", "method")?;
            for (heading, width, _) in METHOD_COLUMNS {
                write!(f, "{heading:>width$}")?;
            }
            for method in &group.methods {
                write!(f, "\n  {:<21}", method.method)?;
                for (_, width, text) in METHOD_COLUMNS {
                    write!(f, "{:>width$}", text(method))?;
                }
            }
            writeln!(f)?;
            let Some((last, others)) = group.methods.split_last() else { continue };
            for baseline in others {
                let times =
                    |value: f64, whole| ratio(value, whole).map_or("–".into(), |r| format!("× {r:.3}"));
                let strain = times(last.raw_mean(Term::Strain), baseline.raw_mean(Term::Strain));
                let total = times(last.total.mean, baseline.total.mean);
                writeln!(f, "  {} against {}: strain {strain}, total {total}", last.method, baseline.method)?;
            }
        }
        Ok(())
    }
}
