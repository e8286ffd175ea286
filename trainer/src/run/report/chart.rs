//! Charts of a run as inline SVG.

use crate::picture::StageBoundary;
use crate::picture::axis::{Axis, number_text};
use crate::run::report::html::escape;
use std::fmt::Write;

/// Size of a chart and of the room for labels around it [SVG units].
const SIZE: [f64; 2] = [560.0, 250.0];
const LEFT: f64 = 58.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 26.0;

/// Parts of the run that are drawn apart: finer than the eye, coarser than a file that grows with every step.
const BINS: usize = 240;

/// A curve over the steps.
pub struct Curve<'a> {
    /// Identifier of the figure.
    pub id: &'a str,
    /// Heading.
    pub title: &'a str,
    /// Unit, empty for none.
    pub unit: &'a str,
    /// (step, value), ascending.
    pub points: &'a [(f64, f64)],
    /// Skinning alone.
    pub baseline: Option<f64>,
}

/// Values of one part of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bin {
    step: f64,
    low: f64,
    median: f64,
    high: f64,
}

/// Figure with a curve: a band from the 5th to the 95th percentile, the median, the baseline dashed, stages marked.
pub fn curve(curve: &Curve, stages: &[StageBoundary], total_steps: f64) -> String {
    let bins = bins(curve.points, total_steps);
    let values = bins.iter().flat_map(|b| [b.low, b.high]).chain(curve.baseline);
    let (x, y) = (Axis::linear(0.0, total_steps.max(1.0)), Axis::fitting(values));
    let mut svg = frame(&x, &y, stages);
    let place = |step: f64, value: f64| place(&x, &y, step, value);
    if !bins.is_empty() {
        let upper = bins.iter().map(|b| place(b.step, b.high));
        let lower = bins.iter().rev().map(|b| place(b.step, b.low));
        let _ = write!(svg, r#"<path class="band" d="{}Z"/>"#, path(upper.chain(lower)));
    }
    if let Some(baseline) = curve.baseline.filter(|v| v.is_finite()) {
        let [[x0, y0], [x1, _]] = [place(0.0, baseline), place(total_steps, baseline)];
        let _ = write!(svg, r#"<path class="baseline" d="M{x0:.1} {y0:.1}H{x1:.1}"/>"#);
    }
    let _ =
        write!(svg, r#"<path class="curve" d="{}"/>"#, path(bins.iter().map(|b| place(b.step, b.median))));
    let latest = latest(curve.points).map_or_else(|| "no data".into(), |v| number_text(v, 3));
    let baseline = match curve.baseline {
        Some(value) => format!(r#" <small class="lbs">LBS {}</small>"#, number_text(value, 3)),
        None => String::new(),
    };
    figure(curve.id, curve.title, curve.unit, &format!("<b>{latest}</b>{baseline}"), &svg)
}

/// Figure of stacked shares of a whole, in the order given: (name, class, points). Every curve has the same steps.
pub fn stacked(
    id: &str,
    title: &str,
    unit: &str,
    parts: &[(&str, Vec<(f64, f64)>)],
    stages: &[StageBoundary],
    total_steps: f64,
) -> String {
    let mut sums: Vec<Bin> = Vec::new();
    let mut areas = Vec::new();
    let mut latest = Vec::new();
    for (name, points) in parts {
        let layer = bins(points, total_steps);
        let below = sums.clone();
        if sums.is_empty() {
            sums = layer.iter().map(|b| Bin { median: 0.0, ..*b }).collect();
        }
        sums.iter_mut().zip(&layer).for_each(|(sum, b)| sum.median += b.median);
        areas.push((sums.clone(), below));
        latest.push((*name, self::latest(points).unwrap_or(0.0)));
    }
    let top = sums.iter().map(|b| b.median).fold(0.0, f64::max);
    let (x, y) = (
        Axis::linear(0.0, total_steps.max(1.0)),
        Axis::linear(0.0, if top > 0.0 { 1.07 * top } else { 1.0 }),
    );
    let mut svg = frame(&x, &y, stages);
    for (i, (above, below)) in areas.iter().enumerate() {
        let upper = above.iter().map(|b| place(&x, &y, b.step, b.median));
        let lower: Vec<[f64; 2]> = match below.is_empty() {
            true => above.iter().map(|b| place(&x, &y, b.step, 0.0)).collect(),
            false => below.iter().map(|b| place(&x, &y, b.step, b.median)).collect(),
        };
        if !above.is_empty() {
            let _ =
                write!(svg, r#"<path class="part{i}" d="{}Z"/>"#, path(upper.chain(lower.into_iter().rev())));
        }
    }
    let legend: String = latest
        .iter()
        .enumerate()
        .map(|(i, (name, value))| {
            format!(
                r#"<span class="key"><i class="part{i}"></i>{} {}</span> "#,
                escape(name),
                number_text(*value, 3)
            )
        })
        .collect();
    figure(id, title, unit, &legend, &svg)
}

fn figure(id: &str, title: &str, unit: &str, latest: &str, svg: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" <small>{}</small>", escape(unit)) };
    format!(
        "<figure id=\"{}\"><figcaption><span>{}{unit}</span> <span>{latest}</span></figcaption>\
            <svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{svg}</svg></figure>\n",
        escape(id),
        escape(title),
        SIZE[0],
        SIZE[1],
        escape(title)
    )
}

/// Grid, tick labels and stage boundaries.
fn frame(x: &Axis, y: &Axis, stages: &[StageBoundary]) -> String {
    let mut svg = String::new();
    let (right, bottom) = (SIZE[0] - RIGHT, SIZE[1] - BOTTOM);
    for tick in y.ticks(6) {
        let at = bottom - y.share(tick) * (bottom - TOP);
        let label = number_text(tick, 3);
        let _ = write!(
            svg,
            r#"<path class="grid" d="M{LEFT} {at:.1}H{right}"/><text class="y" x="{:.1}" y="{:.1}">{label}</text>"#,
            LEFT - 6.0,
            at + 4.0
        );
    }
    for tick in x.ticks(6) {
        let at = LEFT + x.share(tick) * (right - LEFT);
        let label = number_text(tick, 6);
        let _ = write!(svg, r#"<text class="x" x="{at:.1}" y="{:.1}">{label}</text>"#, bottom + 18.0);
    }
    for stage in stages {
        let at = LEFT + x.share(stage.step).clamp(0.0, 1.0) * (right - LEFT);
        let _ = write!(
            svg,
            r#"<path class="stage" d="M{at:.1} {TOP}V{bottom}"><title>{}</title></path>"#,
            escape(&stage.name)
        );
    }
    let _ = write!(svg, r#"<path class="frame" d="M{LEFT} {TOP}V{bottom}H{right}"/>"#);
    svg
}

fn place(x: &Axis, y: &Axis, step: f64, value: f64) -> [f64; 2] {
    let (right, bottom) = (SIZE[0] - RIGHT, SIZE[1] - BOTTOM);
    let share = y.share(y.clamped(value)).clamp(0.0, 1.0);
    [LEFT + x.share(step).clamp(0.0, 1.0) * (right - LEFT), bottom - share * (bottom - TOP)]
}

fn path(points: impl Iterator<Item = [f64; 2]>) -> String {
    let mut out = String::new();
    for (i, [x, y]) in points.enumerate() {
        let _ = write!(out, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
    }
    out
}

/// Where the curve is now: the median of its last fortieth, twenty points at least.
fn latest(points: &[(f64, f64)]) -> Option<f64> {
    let count = (points.len() / 40).max(20);
    let last = &points[points.len().saturating_sub(count)..];
    let mut values: Vec<f64> = last.iter().map(|p| p.1).filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The points in up to [`BINS`] equal parts of the run; values that are not finite are left out.
fn bins(points: &[(f64, f64)], total_steps: f64) -> Vec<Bin> {
    let width = (total_steps / BINS as f64).max(1.0);
    let part = |step: f64| (step / width) as usize;
    let finite: Vec<(f64, f64)> =
        points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
    finite
        .chunk_by(|a, b| part(a.0) == part(b.0))
        .map(|chunk| {
            let mut values: Vec<f64> = chunk.iter().map(|p| p.1).collect();
            values.sort_by(f64::total_cmp);
            let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
            let step = chunk.iter().map(|p| p.0).sum::<f64>() / chunk.len() as f64;
            Bin { step, low: at(0.05), median: at(0.5), high: at(0.95) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_the_spread_of_their_part_and_no_nan() {
        let mut points: Vec<(f64, f64)> = (0..2400).map(|i| (f64::from(i), f64::from(i % 10))).collect();
        points[17].1 = f64::NAN;
        let bins = bins(&points, 2400.0);
        assert_eq!(bins.len(), BINS);
        assert!(bins.iter().all(|b| b.low <= 1.0 && b.high >= 8.0 && (4.0..=5.0).contains(&b.median)));
    }

    #[test]
    fn a_chart_survives_no_data_and_wild_data() {
        for points in [vec![], vec![(1.0, f64::NAN)], vec![(1.0, 1e300), (2.0, -1e300)], vec![(0.0, 0.0)]] {
            let chart = curve(
                &Curve { id: "c", title: "a < b", unit: "J", points: &points, baseline: Some(1.0) },
                &[StageBoundary { step: 0.0, name: "one & two".into() }],
                10.0,
            );
            assert!(chart.contains("a &lt; b") && chart.contains("one &amp; two"));
            assert!(!chart.contains("NaN") && !chart.contains("inf"), "{chart}");
        }
    }
}
