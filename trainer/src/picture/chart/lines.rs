//! Measured quantities over a size.

use super::axis::ChartAxis;
use super::{Chart, LegendKey};
use crate::picture::layer_colour;
use crate::picture::svg::css_colour;

/// One measured quantity.
#[derive(Clone, Debug, Default)]
pub struct ChartLine {
    /// What it is, with its unit.
    pub name: String,
    /// (size, value); points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

impl ChartLine {
    /// Keys of `lines`, for all charts that show them in this order.
    pub fn legend(lines: &[Self]) -> Vec<LegendKey> {
        lines
            .iter()
            .enumerate()
            .map(|(i, line)| LegendKey::line(&attributes("line", i), &line.name))
            .collect()
    }
}

fn attributes(class: &str, index: usize) -> String {
    format!(r#"class="{class}" stroke="{}""#, css_colour(layer_colour(index)))
}

impl Chart {
    /// Quantities that share both axes, which are logarithmic where the values spread widely; `axis_titles`: of the horizontal
    /// and the vertical one. [`ChartLine::legend`] says which is which.
    pub fn of_lines(title: &str, axis_titles: [&str; 2], lines: &[ChartLine]) -> Self {
        let drawable = |point: &&(f64, f64)| point.0.is_finite() && point.1.is_finite();
        let points = || lines.iter().flat_map(|line| &line.points).filter(drawable);
        let axes = [ChartAxis::fitting(points().map(|p| p.0)), ChartAxis::fitting(points().map(|p| p.1))];
        let mut chart = Self::new(title, "", axes, Vec::new()).with_axis_titles(axis_titles);
        for (index, line) in lines.iter().enumerate() {
            let points: Vec<(f64, f64)> = line.points.iter().filter(drawable).copied().collect();
            chart.line(&attributes("line", index), &points);
            // A line of no length with round ends is a dot.
            points.iter().for_each(|&point| chart.line(&attributes("dot", index), &[point, point]));
        }
        if points().next().is_none() {
            chart.latest = "no data".into();
        }
        chart
    }
}

#[cfg(test)]
mod tests {
    use super::super::ChartGrid;
    use super::*;
    use image::Rgb;

    #[test]
    fn every_line_is_drawn_in_its_colour_and_emptiness_is_said() {
        let line = |factor: f64| ChartLine {
            name: format!("{factor} ms"),
            points: vec![(1e3, factor), (2e3, 2.0 * factor), (2e4, 20.0 * factor), (f64::NAN, 1.0)],
        };
        let lines = [line(1.0), line(3.0)];
        let of = |title, lines: &[ChartLine]| Chart::of_lines(title, ["vertices", "time (ms)"], lines);
        let charts = vec![of("growth", &lines), of("none", &[])];
        let svg = charts[0].svg();
        assert!(!svg.contains("no data") && charts[1].svg().contains("no data"));
        assert!(
            svg.contains(">vertices</text>") && svg.contains(">time (ms)</text>") && !svg.contains("1 ms")
        );
        let grid = ChartGrid { title: "growth".into(), legend: ChartLine::legend(&lines), charts };
        let html = grid.html();
        assert_eq!((html.matches("1 ms</span>").count(), html.matches("<figure>").count()), (1, 2));
        let picture = grid.draw();
        for index in 0..2 {
            let colour = Rgb(layer_colour(index));
            let right: usize =
                picture.enumerate_pixels().filter(|(x, y, p)| *x > 150 && *y > 130 && **p == colour).count();
            assert!(right > 100, "line {index}: {right} pixels");
        }
    }
}
