//! The report of a drape as tables for the terminal.

use crate::cli::table::{number, table};
use crate::inference::{PhaseTimes, Report};
use crate::score::Score;

const GARMENTS: [&str; 5] = ["garment", "vertices", "triangles", "fitted", "embedding"];
const TERMS: [&str; 5] = ["strain", "bending", "gravity", "body_collision", "repulsion"];

pub(super) fn tables(report: &Report) -> String {
    let mut parts = vec![garments(report), times(report), scores(report)];
    if !report.certificate.layers.is_empty() {
        parts.push(layers(report));
    }
    parts.push(certificate(report));
    parts.join("\n")
}

fn garments(report: &Report) -> String {
    let rows: Vec<_> = report
        .garments
        .iter()
        .map(|g| {
            vec![
                g.name.clone(),
                g.vertices.to_string(),
                g.triangles.to_string(),
                match &g.fit {
                    Some(fit) => format!(
                        "yes, {} kind{} of repair",
                        fit.repairs.len(),
                        if fit.repairs.len() == 1 { "" } else { "s" }
                    ),
                    None => "no".to_owned(),
                },
                if g.embedding_known { "known" } else { "made" }.to_owned(),
            ]
        })
        .collect();
    table(&GARMENTS, &rows)
}

fn times(report: &Report) -> String {
    let names = report.milliseconds.phases().map(|(name, _)| name);
    let head: Vec<&str> = ["time [ms]"].into_iter().chain(names).chain(["sum"]).collect();
    let row = |name: &str, times: &PhaseTimes| {
        let numbers = times.phases().map(|(_, ms)| ms).into_iter().chain([times.total()]);
        [name.to_owned()].into_iter().chain(numbers.map(|ms| format!("{ms:.1}"))).collect()
    };
    let mut rows: Vec<Vec<String>> = report.garments.iter().map(|g| row(&g.name, &g.milliseconds)).collect();
    let frames = report.frames.len();
    let all = if frames > 1 { format!("all, {frames} frames") } else { "all".to_owned() };
    rows.push(row(&all, &report.milliseconds));
    table(&head, &rows)
}

/// Scores, and what the layers were before, are those of a motion's first frame.
fn of_first_frame(report: &Report, what: &str) -> String {
    if report.frames.len() > 1 { format!("{what}, first frame") } else { what.to_owned() }
}

fn scores(report: &Report) -> String {
    let first = of_first_frame(report, "score");
    let head = [
        first.as_str(),
        "state",
        "strain [J]",
        "bending [J]",
        "gravity [J]",
        "collision [m³]",
        "repulsion [1]",
    ];
    let contact = ["inside [%]", "depth [mm]", "body pairs", "self pairs"];
    let head: Vec<&str> = head.into_iter().chain(contact).collect();
    let row = |score: &Score, state: &str, index: usize| {
        let garment = &score.garments[index];
        let terms = TERMS.map(|term| garment.raw.get(term).map_or_else(String::new, |v| number(*v)));
        let found = &garment.penetration;
        let contact = [
            format!("{:.2}", 100.0 * found.vertices_inside),
            format!("{:.2}", found.max_depth_mm),
            found.body_triangle_pairs.to_string(),
            found.self_triangle_pairs.to_string(),
        ];
        [garment.name.clone(), state.to_owned()].into_iter().chain(terms).chain(contact).collect::<Vec<_>>()
    };
    let rows: Vec<_> = (0..report.garments.len())
        .flat_map(|i| [row(&report.before, "before", i), row(&report.after, "after", i)])
        .collect();
    table(&head, &rows)
}

fn layers(report: &Report) -> String {
    let first = of_first_frame(report, "layers");
    let after = report.frames.first().map_or(&report.certificate, |frame| &frame.certificate);
    let head = [first.as_str(), "pairs before", "after", "layer-order violations before [%]", "after [%]"];
    let name = |i: usize| &report.garments[i].name;
    let rows: Vec<_> = report
        .certificate_before
        .layers
        .iter()
        .zip(&after.layers)
        .map(|(before, after)| {
            vec![
                format!("{} under {}", name(before.inner), name(before.outer)),
                before.triangle_pairs.to_string(),
                after.triangle_pairs.to_string(),
                format!("{:.2}", 100.0 * before.order_violations),
                format!("{:.2}", 100.0 * after.order_violations),
            ]
        })
        .collect();
    table(&head, &rows)
}

fn certificate(report: &Report) -> String {
    let found = &report.certificate;
    let mut text = format!(
        "certificate: {} pairs with the body, {} between layers, {} of garments with themselves; {:.1} mm of contours, \
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
    let pinched = found.pinched.count();
    if pinched > 0 {
        text += &format!("\nwhere the body lies inside itself: {pinched} pairs that no cloth can avoid");
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
            "\nrefined: {} steps ({}), energy {} to {} J, largest move {:.1} mm",
            done.steps,
            done.stop,
            number(done.energy_before),
            number(done.energy_after),
            done.largest_move_mm
        );
    }
    text + "\n"
}
