//! Quantities over the steps of a run.

use super::axis::{ChartAxis, number_text};
use super::{Chart, LegendKey};
use crate::picture::svg::{escape, fitted, write_text};
use std::fmt::Write;

/// Parts of the run that are drawn apart: finer than the eye, coarser than a file that grows with every step.
const BINS: usize = 240;
/// Steps whose spread a part shows at least; in a short run they belong to its neighbours too.
const BIN_STEPS: usize = 5;
/// Font size and height of the names of stages.
const STAGE_SIZE: f64 = 9.0;
const STAGE_LINE: f64 = 11.0;

/// Where a stage of the schedule begins.
#[derive(Clone, Debug)]
pub struct StageBoundary {
    /// First step of the stage.
    pub step: f64,
    /// Name of the stage.
    pub name: String,
}

/// The mean of a quantity with linear blend skinning alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baseline {
    /// The mean.
    pub value: f64,
    /// Whether it is of scenes like those of the steps, so that a ratio means something.
    pub is_comparable: bool,
}

/// The steps of a run.
#[derive(Clone, Debug)]
pub struct RunSteps {
    /// Their number.
    pub total: u64,
    /// Where stages begin, ascending.
    pub stages: Vec<StageBoundary>,
}

/// Values of one part of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bin {
    step: f64,
    low: f64,
    median: f64,
    high: f64,
}

impl RunSteps {
    /// What the marks of [`RunSteps::curve`] stand for.
    pub fn legend() -> Vec<LegendKey> {
        vec![
            LegendKey::line(r#"class="curve""#, "median"),
            LegendKey::area(r#"class="band""#, "5th to 95th percentile"),
            LegendKey::line(r#"class="baseline""#, "LBS + shape transfer (validation)"),
            LegendKey::line(r#"class="stage""#, "stage begins"),
        ]
    }

    /// The median of a quantity in a band from the 5th to the 95th percentile, the `baselines` of the stages, and where
    /// stages begin. `points` are (step, value), ascending.
    pub fn curve(
        &self,
        title: &str,
        unit: &str,
        points: &[(f64, f64)],
        baselines: &[Option<Baseline>],
    ) -> Chart {
        let bins = self.bins(points);
        let line = |value: fn(&Bin) -> f64| bins.iter().map(|b| (b.step, value(b))).collect::<Vec<_>>();
        let [low, median, high] = [line(|b| b.low), line(|b| b.median), line(|b| b.high)];
        let largest = high.iter().map(|point| point.1.abs()).fold(0.0, f64::max);
        let rounded = |baseline: Baseline| match baseline.value {
            // What rounding leaves of a zero.
            value if value.abs() < f64::from(f32::EPSILON) * largest => Baseline { value: 0.0, ..baseline },
            _ => baseline,
        };
        let drawable = |baseline: &Option<Baseline>| baseline.filter(|b| b.value.is_finite()).map(rounded);
        let baselines: Vec<_> = baselines.iter().map(drawable).collect();
        let lines = baselines.iter().flatten().map(|baseline| baseline.value);
        let values = low.iter().chain(&high).map(|point| point.1).chain(lines);
        let mut chart = self.chart(title, unit, ChartAxis::fitting(values), Vec::new());
        chart.area(r#"class="band""#, &high, &low);
        for (range, baseline) in self.stage_ranges().zip(&baselines) {
            if let Some(Baseline { value, .. }) = baseline {
                chart.line(r#"class="baseline""#, &range.map(|step| (step, *value)));
            }
        }
        chart.line(r#"class="curve""#, &median);
        // That of the stage in which the points end.
        let last = points.last().map_or(0.0, |point| point.0);
        let stage = self.stages.iter().rposition(|stage| stage.step <= last).unwrap_or(0);
        chart.latest = latest_text(points, baselines.get(stage).copied().flatten());
        chart
    }

    /// First step and end of every stage.
    fn stage_ranges(&self) -> impl Iterator<Item = [f64; 2]> {
        let ends = self.stages.iter().skip(1).map(|stage| stage.step).chain([self.total.max(1) as f64]);
        self.stages.iter().zip(ends).map(|(stage, end)| [stage.step, end])
    }

    /// Shares of a whole, stacked in the order given. All of them have the same steps.
    pub fn stacked(&self, title: &str, unit: &str, parts: &[(&str, Vec<(f64, f64)>)]) -> Chart {
        let keys = parts.iter().enumerate().map(|(i, (name, points))| {
            let latest = number_text(latest(points).unwrap_or(0.0), 3);
            LegendKey::area(&format!(r#"class="part{i}""#), &format!("{name} {latest}"))
        });
        let bins: Vec<Vec<Bin>> = parts.iter().map(|(_, points)| self.bins(points)).collect();
        let ground = bins.iter().take(1).flatten().map(|b| (b.step, 0.0)).collect();
        let mut edges: Vec<Vec<(f64, f64)>> = vec![ground];
        for (i, bins) in bins.iter().enumerate() {
            let sums = edges[i].iter().zip(bins).map(|((step, sum), b)| (*step, sum + b.median));
            edges.push(sums.collect());
        }
        let top = edges.last().into_iter().flatten().map(|point| point.1).fold(0.0, f64::max);
        let values = ChartAxis::linear(0.0, if top > 0.0 { 1.07 * top } else { 1.0 });
        let mut chart = self.chart(title, unit, values, keys.collect());
        for (i, edge) in edges.windows(2).enumerate() {
            chart.area(&format!(r#"class="part{i}""#), &edge[1], &edge[0]);
        }
        chart
    }

    /// A chart with the stages alone: a line where each begins, and its name above where there is space for it.
    fn chart(&self, title: &str, unit: &str, values: ChartAxis, legend: Vec<LegendKey>) -> Chart {
        let end = self.total.max(1) as f64;
        let mut chart = Chart::new(title, unit, [ChartAxis::linear(0.0, end), values], legend);
        chart.top += STAGE_LINE;
        for (StageBoundary { name, .. }, [step, end]) in self.stages.iter().zip(self.stage_ranges()) {
            let [x, bottom] = chart.place((step, f64::NEG_INFINITY));
            let [next, top] = chart.place((end, f64::INFINITY));
            let line = format!("M{x:.1} {top}V{bottom}");
            let tooltip = escape(name);
            let _ = write!(chart.marks, r#"<path class="stage" d="{line}"><title>{tooltip}</title></path>"#);
            let shown = fitted(name, next - x - 6.0, STAGE_SIZE);
            if shown == *name || shown.chars().count() > 3 {
                write_text(&mut chart.marks, "stage-name", [x, top - 3.0], STAGE_SIZE, &shown);
            }
        }
        chart
    }

    /// The points in up to [`BINS`] equal parts of the run; values that are not finite are left out.
    fn bins(&self, points: &[(f64, f64)]) -> Vec<Bin> {
        let width = (self.total as f64 / BINS as f64).max(1.0);
        let part = |point: &(f64, f64)| (point.0 / width) as usize;
        let finite: Vec<(f64, f64)> =
            points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
        let mut first = 0;
        finite
            .chunk_by(|a, b| part(a) == part(b))
            .map(|chunk| {
                let margin = BIN_STEPS.saturating_sub(chunk.len()).div_ceil(2);
                let end = first + chunk.len();
                let window = &finite[first.saturating_sub(margin)..(end + margin).min(finite.len())];
                first = end;
                let values = sorted(window);
                let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
                let step = chunk.iter().map(|p| p.0).sum::<f64>() / chunk.len() as f64;
                Bin { step, low: at(0.05), median: at(0.5), high: at(0.95) }
            })
            .collect()
    }
}

/// Values of points, ascending.
fn sorted(points: &[(f64, f64)]) -> Vec<f64> {
    let mut values: Vec<f64> = points.iter().map(|p| p.1).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The median of the last `count` values, of those that are finite.
pub(crate) fn median_of_last(points: &[(f64, f64)], count: usize) -> Option<f64> {
    let mut values = sorted(&points[points.len().saturating_sub(count)..]);
    values.retain(|value| value.is_finite());
    values.get(values.len() / 2).copied()
}

/// Where the curve is now: the median of its last fortieth, twenty points at least.
fn latest(points: &[(f64, f64)]) -> Option<f64> {
    median_of_last(points, (points.len() / 40).max(20))
}

/// The latest value, beside the baseline.
fn latest_text(points: &[(f64, f64)], baseline: Option<Baseline>) -> String {
    let Some(value) = latest(points) else { return "no data".to_owned() };
    let mut text = number_text(value, 3);
    if let Some(Baseline { value: baseline, is_comparable }) = baseline {
        text += r#"<tspan class="lbs" dx="5">"#;
        if is_comparable && value > 0.0 && baseline > 0.0 {
            text += &format!("{} × ", number_text(value / baseline, 2));
        }
        text += &format!("LBS + shape {}</tspan>", number_text(baseline, 3));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::ChartGrid;
    use super::*;

    #[test]
    fn bins_hold_the_spread_of_their_part_and_no_nan() {
        let steps = RunSteps { total: 2400, stages: Vec::new() };
        let mut points: Vec<(f64, f64)> = (0..2400).map(|i| (f64::from(i), f64::from(i % 10))).collect();
        points[17].1 = f64::NAN;
        let bins = steps.bins(&points);
        assert_eq!(bins.len(), BINS);
        assert!(bins.iter().all(|b| b.low <= 1.0 && b.high >= 8.0 && (4.0..=5.0).contains(&b.median)));
    }

    #[test]
    fn bins_of_a_short_run_ignore_outliers_in_the_median_and_show_them_in_the_band() {
        let steps = RunSteps { total: 100, stages: Vec::new() };
        let mut points: Vec<(f64, f64)> =
            (0..100).map(|k| (f64::from(k), (f64::from(k) * 0.37).sin())).collect();
        points[50].1 = 1e9;
        let bins = steps.bins(&points);
        assert_eq!(bins.len(), 100);
        for (k, bin) in bins.iter().enumerate() {
            let window = sorted(&points[k.saturating_sub(2)..=(k + 2).min(99)]);
            assert_eq!(
                (bin.step, bin.median),
                (k as f64, window[((window.len() - 1) as f64 / 2.0).round() as usize])
            );
            assert!(bin.median <= 1.0 && (bin.high > 1.0) == (48..=52).contains(&k));
        }
        assert_eq!(steps.bins(&[(3.0, 4.0)]), [Bin { step: 3.0, low: 4.0, median: 4.0, high: 4.0 }]);
        assert!(steps.bins(&[]).is_empty());
    }

    #[test]
    fn a_chart_survives_no_data_and_wild_data() {
        let cases = [
            vec![],
            vec![(0.0, 3.0)],
            vec![(5.0, -1.0), (6.0, -2.0)],
            vec![(0.0, 0.0), (1.0, 0.0)],
            vec![(0.0, 0.0), (1.0, 1e-5), (2.0, 10.0)],
            vec![(f64::NAN, 1.0), (1.0, f64::INFINITY), (2.0, 1e300), (3.0, 1.0)],
            vec![(1e300, 1.0), (7.0, 1.0), (7.0, 2.0)],
            vec![(1.0, 1e300), (2.0, -1e300)],
            vec![(0.0, 1e-320), (1.0, 4.0)],
        ];
        for points in cases {
            for value in [None, Some(0.0), Some(-3.0), Some(2.0), Some(f64::NAN)] {
                let stages = vec![
                    StageBoundary { step: 0.0, name: "one & two".into() },
                    StageBoundary { step: f64::NAN, name: "never".into() },
                ];
                let steps = RunSteps { total: 10, stages };
                let baselines = [value.map(|value| Baseline { value, is_comparable: true }), None];
                let curve = steps.curve("a < b", "J", &points, &baselines);
                let svg = curve.svg();
                assert!(svg.contains("a &lt; b") && svg.contains("one &amp; two"));
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
                let charts = vec![curve, steps.stacked("b", "", &[("part", points.clone())])];
                ChartGrid { title: "run".into(), legend: RunSteps::legend(), charts }.draw();
            }
        }
    }

    #[test]
    fn curve_baseline_and_stage_leave_their_colours_in_the_picture() {
        let points: Vec<(f64, f64)> =
            (0..400).map(|k| (f64::from(k), 50.0 * (-0.01 * f64::from(k)).exp())).collect();
        let stage = |step, name: &str| StageBoundary { step, name: name.into() };
        let first = [stage(0.0, "single")];
        let count = |more: &[StageBoundary], baseline: Option<f64>, colour: [u8; 3]| {
            let steps = RunSteps { total: 400, stages: [&first, more].concat() };
            let baselines = [baseline.map(|value| Baseline { value, is_comparable: true })];
            let charts = vec![steps.curve("strain", "J", &points, &baselines)];
            let picture = ChartGrid { title: "run".into(), legend: Vec::new(), charts }.draw();
            let near = |p: &&image::Rgb<u8>| p.0.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 40);
            picture.pixels().filter(near).count()
        };
        let (curve, baseline, boundary) = ([36, 84, 148], [214, 104, 36], [140, 120, 160]);
        assert!(count(&[], None, curve) > 300);
        assert!(count(&[], Some(20.0), baseline) > count(&[], None, baseline) + 150);
        let layers = [stage(200.0, "layers")];
        assert!(count(&layers, None, boundary) > count(&[], None, boundary) + 50);
        // The second stage has no baseline of its own; the first one's stands in words too, where it is the last.
        let [whole, half] = [&[][..], &layers].map(|more| count(more, Some(20.0), baseline) as f64);
        assert!((0.25..0.6).contains(&(half / whole)), "{half} of {whole}");
    }

    #[test]
    fn a_ratio_is_of_like_things_and_never_to_zero() {
        let steps = RunSteps {
            total: 40,
            stages: vec![
                StageBoundary { step: 0.0, name: "single".into() },
                StageBoundary { step: 20.0, name: "layers".into() },
            ],
        };
        let curve = |end: u32, value: f64, first: f64, second: Option<(f64, bool)>| {
            let points: Vec<(f64, f64)> = (0..end).map(|step| (f64::from(step), value)).collect();
            let second = second.map(|(value, is_comparable)| Baseline { value, is_comparable });
            let first = Some(Baseline { value: first, is_comparable: true });
            steps.curve("strain", "J", &points, &[first, second]).latest
        };
        assert!(curve(20, 1.0, 2.0, Some((8.0, true))).contains("0.5 × LBS + shape 2<"));
        assert!(curve(40, 1.0, 2.0, Some((8.0, true))).contains("0.12 × LBS + shape 8<"));
        // Outfits of other sizes have other sums, and nothing is a share of nothing.
        for (value, first, second) in
            [(1.0, 2.0, Some((8.0, false))), (1.0, 2.0, Some((1e-15, true))), (0.0, 2.0, Some((8.0, true)))]
        {
            let text = curve(40, value, first, second);
            assert!(text.contains("LBS + shape") && !text.contains('×'), "{text}");
        }
        assert_eq!(curve(40, 1.0, 2.0, None), "1");
    }
}
