//! Scores gathered over scenes, and the table that compares methods.

use super::score::SceneScore;
use clothcombo_physics::energy::Term;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// Mean, median and 95th percentile over scenes.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
}

impl Spread {
    /// The spread of `values`; all zero when there are none.
    pub fn of(mut values: Vec<f64>) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        values.sort_by(f64::total_cmp);
        let n = values.len();
        let median = 0.5 * (values[(n - 1) / 2] + values[n / 2]);
        let p95 = values[((n as f64 * 0.95).ceil() as usize).clamp(1, n) - 1];
        Self { mean: values.iter().sum::<f64>() / n as f64, median, p95 }
    }
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
    /// Share of outer vertices on the wrong side of an inner layer, among those within 5 cm of it.
    pub wrong_side: f64,
}

impl MethodScore {
    /// Gathers the scores of `method`.
    pub fn new(method: &'static str, scenes: &[SceneScore]) -> Self {
        let over = |f: &dyn Fn(&SceneScore) -> f64| Spread::of(scenes.iter().map(f).collect());
        let share = |part: &dyn Fn(&SceneScore) -> usize, whole: &dyn Fn(&SceneScore) -> usize| {
            let (p, w): (usize, usize) = scenes.iter().fold((0, 0), |a, s| (a.0 + part(s), a.1 + whole(s)));
            if w == 0 { 0.0 } else { p as f64 / w as f64 }
        };
        Self {
            method,
            total: over(&|s| s.total),
            raw: Term::ALL.into_iter().map(|t| (t.name(), over(&|s| s.raw[t]))).collect(),
            weighted: Term::ALL.into_iter().map(|t| (t.name(), over(&|s| s.weighted[t]).mean)).collect(),
            inside: share(&|s| s.penetration.inside, &|s| s.penetration.vertices),
            deeper_than_5mm: share(&|s| s.penetration.deep, &|s| s.penetration.vertices),
            wrong_side: share(&|s| s.order.violations, &|s| s.order.counted),
        }
    }
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
    /// One number to compare networks by: mean total loss of the whole network, mean over the groups; less is better.
    /// `None` without scenes, or where it is not finite.
    pub fn score(&self) -> Option<f64> {
        let totals: Vec<f64> =
            self.groups.iter().filter_map(|g| Some(g.methods.last()?.total.mean)).collect();
        let score = totals.iter().sum::<f64>() / totals.len() as f64;
        score.is_finite().then_some(score)
    }
}

impl fmt::Display for ValidationReport {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for group in &self.groups {
            writeln!(f, "{} ({} scenes; energies raw in J, mean per scene)", group.group, group.scenes)?;
            writeln!(
                f,
                "  {:<15}{:>10}{:>10}{:>10}{:>10}{:>10}{:>12}{:>10}{:>10}{:>10}{:>10}",
                "method",
                "total",
                "median",
                "strain",
                "bending",
                "gravity",
                "collision",
                "holding",
                "inside %",
                ">5 mm %",
                "wrong %"
            )?;
            for m in &group.methods {
                let raw = |t: Term| m.raw[t.name()].mean;
                writeln!(
                    f,
                    "  {:<15}{:>10.3}{:>10.3}{:>10.3}{:>10.4}{:>10.3}{:>12.2e}{:>10.4}{:>10.2}{:>10.2}{:>10.2}",
                    m.method,
                    m.total.mean,
                    m.total.median,
                    raw(Term::Strain),
                    raw(Term::Bending),
                    raw(Term::Gravity),
                    raw(Term::BodyCollision),
                    raw(Term::Holding),
                    100.0 * m.inside,
                    100.0 * m.deeper_than_5mm,
                    100.0 * m.wrong_side
                )?;
            }
            let Some((last, others)) = group.methods.split_last() else { continue };
            for baseline in others {
                writeln!(
                    f,
                    "  {} against {}: strain × {:.3}, total × {:.3}",
                    last.method,
                    baseline.method,
                    last.raw[Term::Strain.name()].mean / baseline.raw[Term::Strain.name()].mean,
                    last.total.mean / baseline.total.mean
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_of_known_values() {
        let s = Spread::of((1..=100).map(f64::from).collect());
        assert_eq!((s.mean, s.median, s.p95), (50.5, 50.5, 95.0));
        assert_eq!(Spread::of(vec![7.0]).p95, 7.0);
    }
}
