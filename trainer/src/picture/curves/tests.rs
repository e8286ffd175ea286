use super::*;

fn series(points: Vec<(f64, f64)>, baseline: Option<f64>) -> Series {
    Series { name: "strain".into(), unit: "J".into(), points, baseline }
}

fn count(picture: &RgbImage, RGBColor(red, green, blue): RGBColor) -> usize {
    picture.pixels().filter(|pixel| pixel.0 == [red, green, blue]).count()
}

#[test]
fn nothing_one_point_negative_zero_and_wild_values_are_drawn() {
    let cases = [
        vec![],
        vec![(0.0, 3.0)],
        vec![(5.0, -1.0), (6.0, -2.0)],
        vec![(0.0, 0.0), (1.0, 0.0)],
        vec![(0.0, 0.0), (1.0, 1e-5), (2.0, 10.0)],
        vec![(f64::NAN, 1.0), (1.0, f64::INFINITY), (2.0, 1e300), (3.0, 1.0)],
        vec![(1e300, 1.0), (7.0, 1.0), (7.0, 2.0)],
        vec![(0.0, 1e-320), (1.0, 4.0)],
    ];
    for points in cases {
        for baseline in [None, Some(0.0), Some(-3.0), Some(2.0), Some(f64::NAN)] {
            let stages = [
                StageBoundary { step: 1.0, name: "two".into() },
                StageBoundary { step: f64::NAN, name: "never".into() },
            ];
            let picture = draw_curves("run", &[series(points.clone(), baseline)], &stages).unwrap();
            assert_eq!(picture.dimensions(), (PANEL[0], PANEL[1] + HEADER_HEIGHT));
        }
    }
    assert!(draw_curves("", &[], &[]).is_ok());
}

#[test]
fn curve_baseline_and_stage_leave_their_colours_in_the_panel() {
    let points: Vec<(f64, f64)> =
        (0..400).map(|k| (f64::from(k), 50.0 * (-0.01 * f64::from(k)).exp())).collect();
    let plain = draw_curves("run", &[series(points.clone(), None)], &[]).unwrap();
    let stage = StageBoundary { step: 200.0, name: "layers".into() };
    let full = draw_curves("run", &[series(points, Some(20.0))], &[stage]).unwrap();
    assert!(count(&full, CURVE) > 300);
    assert!(count(&full, BASELINE) > count(&plain, BASELINE) + 150);
    assert!(full != plain);
}

#[test]
fn panels_fill_a_grid() {
    let one = series(vec![(0.0, 1.0), (1.0, 2.0)], None);
    for (number, columns, rows) in [(1, 1, 1), (2, 2, 1), (3, 3, 1), (4, 2, 2), (9, 3, 3), (10, 3, 4)] {
        let picture = draw_curves("run", &vec![one.clone(); number], &[]).unwrap();
        assert_eq!(picture.dimensions(), (columns * PANEL[0], rows * PANEL[1] + HEADER_HEIGHT));
    }
}

#[test]
fn the_moving_median_ignores_outliers_and_equals_the_sorted_middle() {
    let mut points: Vec<(f64, f64)> =
        (0..1000).map(|k| (f64::from(k), (f64::from(k) * 0.37).sin())).collect();
    points[500].1 = 1e9;
    let median = moving_median(&points);
    assert_eq!(median.len(), CURVE_POINTS);
    assert_eq!((median[0].0, median[CURVE_POINTS - 1].0), (0.0, 999.0));
    for &(step, value) in &median {
        let centre = step as usize;
        let range = centre.saturating_sub(12)..=(centre + 12).min(999);
        let mut window: Vec<f64> = points[range].iter().map(|point| point.1).collect();
        window.sort_by(f64::total_cmp);
        assert_eq!(value, window[window.len() / 2]);
    }
    assert!(median.iter().all(|point| point.1 <= 1.0));
    assert_eq!(moving_median(&[(3.0, 4.0)]), [(3.0, 4.0)]);
    assert!(moving_median(&[]).is_empty());
}

#[test]
fn steps_are_short() {
    for (step, text) in [(0.0, "0"), (500.0, "500"), (1500.0, "1500"), (20_000.0, "20k"), (2.5e6, "2.5M")] {
        assert_eq!(step_text(step), text);
    }
}
