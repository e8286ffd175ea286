//! The report of a drape as tables for the terminal.

use crate::cli::post_process::left_over;
use crate::cli::score::term_cells;
use crate::cli::table::{number, row, table};
use crate::inference::{DrapeReport, PhaseTimes};
use crate::score::Score;
use clothcombo_physics::contact::resolve::Certificate;

pub(super) fn tables(report: &DrapeReport) -> String {
    let mut parts = vec![garments(report), times(report), scores(report)];
    if !report.certificate.layers.is_empty() {
        parts.push(layers(report));
    }
    parts.push(certificate(report));
    parts.join("\n")
}

fn garments(report: &DrapeReport) -> String {
    let rows = report.garments.iter().map(|g| {
        let repairs = g.fit.as_ref().map(|fit| fit.repairs.len());
        row! {
            "garment" => g.name,
            "vertices" => g.vertices,
            "triangles" => g.triangles,
            "fitted" => match repairs {
                Some(1) => "yes, 1 kind of repair".to_owned(),
                Some(count) => format!("yes, {count} kinds of repair"),
                None => "no".to_owned(),
            },
            "embedding" => if g.embedding_known { "known" } else { "made" },
        }
    });
    table(&rows.collect::<Vec<_>>())
}

fn times(report: &DrapeReport) -> String {
    let row = |name: &str, times: &PhaseTimes| {
        let mut row = row!["time [ms]" => name];
        row.extend(times.phases().map(|(phase, ms)| (phase.to_string(), format!("{ms:.1}"))));
        row.extend(row!["sum" => format!("{:.1}", times.total())]);
        row
    };
    let frames = report.frames.len();
    let all = if frames > 1 { format!("all, {frames} frames") } else { "all".to_owned() };
    let garments = report.garments.iter().map(|g| row(&g.name, &g.milliseconds));
    table(&garments.chain([row(&all, &report.milliseconds)]).collect::<Vec<_>>())
}

/// Scores, the refinement and what the layers were before are those of a motion's first frame.
fn of_first_frame(report: &DrapeReport, what: &str) -> String {
    if report.frames.len() > 1 { format!("{what}, first frame") } else { what.to_owned() }
}

fn scores(report: &DrapeReport) -> String {
    let first = of_first_frame(report, "score");
    let after = report.frames.first().map_or(&report.certificate, |frame| &frame.certificate);
    // Pairs as the certificate counts them.
    let row = |score: &Score, certificate: &Certificate, state: &str, index: usize| {
        let (garment, pairs) = (&score.garments[index], &certificate.garments[index]);
        let contact = row! {
            "inside, nearest vertex [%]" => 100.0 * garment.penetration.vertices_inside,
            "depth, nearest vertex [mm]" => garment.penetration.max_depth_mm,
            "body pairs" => pairs.body_triangle_pairs,
            "layer pairs" => pairs.layer_triangle_pairs,
            "self pairs" => pairs.self_triangle_pairs,
        };
        let name = row![first => garment.name, "state" => state];
        [name, term_cells(&garment.raw, true), contact].concat()
    };
    let both = |i| {
        [row(&report.before, &report.certificate_before, "before", i), row(&report.after, after, "after", i)]
    };
    table(&(0..report.garments.len()).flat_map(both).collect::<Vec<_>>())
}

fn layers(report: &DrapeReport) -> String {
    let first = of_first_frame(report, "layers");
    let after = report.frames.first().map_or(&report.certificate, |frame| &frame.certificate);
    let name = |i: usize| &report.garments[i].name;
    let rows = report.certificate_before.layers.iter().zip(&after.layers).map(|(before, after)| {
        row! {
            first => format!("{} under {}", name(before.inner), name(before.outer)),
            "pairs before" => before.triangle_pairs,
            "after" => after.triangle_pairs,
            "layer-order violations before [%]" => 100.0 * before.order_violations,
            "after [%]" => 100.0 * after.order_violations,
        }
    });
    table(&rows.collect::<Vec<_>>())
}

fn certificate(report: &DrapeReport) -> String {
    let found = &report.certificate;
    let of_all = match report.frames.len() {
        0 | 1 => String::new(),
        frames => format!(" of all {frames} frames"),
    };
    let mut text = format!(
        "certificate{of_all}: {} pairs with the body, {} between layers, {} of garments with themselves; {:.1} mm of contours, \
         largest depth {:.2} mm",
        found.body_triangle_pairs,
        found.layer_triangle_pairs,
        found.self_triangle_pairs,
        found.contour_length_mm,
        found.max_depth_mm
    );
    if let Some(strain) = found.strain_added {
        let worst = if report.frames.len() > 1 { " in the worst frame" } else { "" };
        // Without the sign of what rounds to nothing.
        let percent = (1e3 * strain).round() / 10.0 + 0.0;
        text += &format!(", strain {percent:+.1} %{worst}");
    }
    if let Some(left) = left_over(found.pairs(), found.is_stopped) {
        text += &format!("\n{left}");
    }
    let pinched = found.pinched.count();
    if pinched > 0 {
        text += &format!(
            "\nnot counted: {pinched} pairs where the body lies inside itself, which no cloth can avoid"
        );
    }
    if let Some(done) = &report.smoothing {
        text += &format!(
            "\nsmoothed over ±{} frames: {} frames wholly, {} in part, {} left as they were",
            done.radius, done.whole, done.partly, done.left
        );
    }
    if let Some(found) = &report.acceleration {
        text += &format!(
            "\nacceleration of 95 % of the vertices at most {} m/s², {:.2} times that of skinning \
             ({:.2} before the post-process)",
            number(found.draped_95),
            found.ratio,
            found.before_95 / found.skinned_95
        );
    }
    if let Some(done) = &report.refinement {
        text += &format!(
            "\n{}: {} steps ({}), energy {} to {} J, largest move {:.1} mm",
            of_first_frame(report, "refined"),
            done.steps,
            done.stop,
            number(done.energy_before),
            number(done.energy_after),
            done.largest_move_mm
        );
    }
    text + "\n"
}
