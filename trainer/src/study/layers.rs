//! Table 3: what several layers cost each garment, and what is on the wrong side before and after the post-process.

use super::estimate::{Estimate, Ratio};
use super::subject::Subject;
use super::table::{Table, number, percent};
use crate::drape::NetworkDrape;
use crate::evaluate::certificates::{Counts, Dressing, OutfitResult};
use crate::scene::{PreparedScene, Unseen};
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::energy::Term;
use miette::{IntoDiagnostic, Report};
use serde::Serialize;

/// Outfits of one number of layers.
#[derive(Clone, Debug, Serialize)]
pub struct LayerCount {
    /// Number of garments M.
    pub layers: usize,
    /// Number of outfits.
    pub scenes: usize,
    /// How many of them, the first, went through the post-process.
    pub resolved: usize,
    /// Strain of each layer in the outfit over that of the same garment draped alone, innermost first.
    pub strain: Vec<Ratio>,
    /// Median over the outfits of the ratio of each.
    pub strain_median: Vec<f64>,
    /// Strain of the garments draped alone [J].
    pub strain_alone: Estimate,
    /// Strain of the same garments in the outfit [J].
    pub strain_worn: Estimate,
    /// Share of outer vertices on the wrong side, closest surface point: every garment draped alone.
    pub wrong_side_single: Estimate,
    /// The same after untangling.
    pub wrong_side: Estimate,
    /// The same after the post-process.
    pub wrong_side_resolved: Estimate,
    /// Share of outfits without an intersection with the body or between garments: all before the post-process, those that
    /// went through it after it.
    pub clear: [f64; 2],
    /// Rise of the strain energy by the post-process, median share.
    pub strain_added: f64,
    /// Exact pairs between garments before the post-process.
    pub layer_pairs: Estimate,
    /// Time of the post-process per garment, means of outfits [ms].
    pub post_ms: Estimate,
}

/// Drapes `scenes` random outfits of `layers` garments of the whole wardrobe, held-out ones among them, in random order, and
/// resolves the first `resolved` of them with `settings`.
///
/// # Errors
/// When a scene cannot be draped or resolved.
pub fn ask(
    subject: &Subject,
    question: usize,
    layers: usize,
    [scenes, resolved]: [usize; 2],
    settings: &ResolveSettings,
    done: &(dyn Fn() + Sync),
) -> Result<LayerCount, Report> {
    let all: Vec<usize> = (0..subject.library.wardrobe.len()).collect();
    let networks = subject.networks();
    let dressing = Dressing::new(&subject.library, &subject.config.losses, Some(&networks));
    let (mut single, mut layered) = (vec![Vec::new(); layers], vec![Vec::new(); layers]);
    let (mut wrong_single, mut before, mut results) = (Vec::new(), Vec::new(), Vec::new());
    for index in 0..scenes {
        let draw = subject.draw([question, index], &all, layers, Unseen::Poses);
        let scene = subject.prepare(draw)?;
        let drape = networks.drape(&scene)?;
        for (layer, [alone, worn]) in strains(&scene, &drape).into_iter().enumerate() {
            single[layer].push(alone);
            layered[layer].push(worn);
        }
        let alone = dressing.of(&scene, &drape.single.posed);
        wrong_single.push(alone.certificate().into_diagnostic()?.order_violations);
        let draped = dressing.of(&scene, &drape.layered.posed);
        if index < resolved {
            let result = OutfitResult::new(index, &draped, settings)?.0;
            before.push(result.before);
            results.push(result);
        } else {
            before.push(draped.counts().into_diagnostic()?);
        }
        done();
    }
    let shares = |values: &mut dyn Iterator<Item = f64>| Estimate::of(&values.collect::<Vec<_>>());
    let clear = |all: &mut dyn Iterator<Item = bool>| {
        shares(&mut all.map(|is_clear| f64::from(u8::from(is_clear)))).spread.mean
    };
    let added: Vec<f64> = results.iter().filter_map(|r| r.strain_added).collect();
    // The garments of an outfit are no independent scenes.
    let times: Vec<f64> =
        results.iter().map(|r| r.milliseconds.iter().sum::<f64>() / layers as f64).collect();
    let of_outfits = |layers: &[Vec<f64>]| {
        let mean = |i: usize| layers.iter().map(|values| values[i]).sum::<f64>() / layers.len() as f64;
        Estimate::of(&(0..scenes).map(mean).collect::<Vec<_>>())
    };
    let ratios = |layer: usize| -> Vec<f64> {
        single[layer].iter().zip(&layered[layer]).map(|(alone, worn)| worn / alone).collect()
    };
    Ok(LayerCount {
        layers,
        scenes,
        resolved: results.len(),
        strain: (0..layers).map(|l| Ratio::of(&layered[l], &single[l])).collect(),
        strain_median: (0..layers).map(|l| Estimate::of(&ratios(l)).spread.median).collect(),
        strain_alone: of_outfits(&single),
        strain_worn: of_outfits(&layered),
        wrong_side_single: Estimate::of(&wrong_single),
        wrong_side: shares(&mut before.iter().map(|c| c.order_violations)),
        wrong_side_resolved: shares(&mut results.iter().map(|r| r.after.order_violations)),
        clear: [
            clear(&mut before.iter().map(Counts::is_clear)),
            clear(&mut results.iter().map(|r| r.after.is_clear())),
        ],
        strain_added: Estimate::of(&added).spread.median,
        layer_pairs: shares(&mut before.iter().map(|c| c.layer_triangle_pairs as f64)),
        post_ms: Estimate::of(&times),
    })
}

/// Strain of every garment draped alone and in the outfit [J].
fn strains(scene: &PreparedScene, drape: &NetworkDrape) -> Vec<[f64; 2]> {
    let energy = &scene.bodies[0].energy;
    let [single, layered] =
        [&drape.single, &drape.layered].map(|d| energy.raw(&d.posed, &d.canonical).garments);
    let strain = |raw: &clothcombo_physics::energy::TermMap<Option<f64>>| raw[Term::Strain].unwrap_or(0.0);
    single.iter().zip(&layered).map(|(alone, worn)| [strain(alone), strain(worn)]).collect()
}

/// The paper's Table 3: rows M = 1 to 6.
const PAPER: [&[f64]; 6] = [
    &[1.0],
    &[1.10, 1.29],
    &[1.16, 1.28, 1.33],
    &[1.32, 1.47, 1.43, 1.83],
    &[1.40, 1.63, 1.45, 1.69, 2.07],
    &[1.61, 1.46, 1.44, 1.63, 1.72, 2.65],
];

/// As tables.
pub fn tables(counts: &[LayerCount]) -> Vec<Table> {
    let most = counts.iter().map(|c| c.layers).max().unwrap_or(0);
    let numbers: Vec<String> = (1..=most).map(|l| l.to_string()).collect();
    let head: Vec<&str> = ["layers M"].into_iter().chain(numbers.iter().map(String::as_str)).collect();
    let filled = |mut row: Vec<String>| {
        row.resize(most + 1, String::new());
        row
    };
    let mut strain = Table::new("Strain of each layer, innermost first, over the same garment draped alone", &head)
        .with_note("Ratio of means (median of the ratios); after the networks, before the post-process. More than 6 layers were never trained on.");
    for count in counts {
        let cells = count.strain.iter().zip(&count.strain_median);
        let mut row = vec![format!("M = {}", count.layers)];
        row.extend(cells.map(|(r, median)| format!("{} ({})", number(r.of_means), number(*median))));
        strain.rows.push(filled(row));
        if let Some(paper) = PAPER.get(count.layers - 1) {
            let mut row = vec![format!("paper, M = {}", count.layers)];
            row.extend(paper.iter().map(|v| format!("{v:.2}")));
            strain.rows.push(filled(row));
        }
    }
    let mut order = Table::new(
        "Order and contact of the layers",
        &[
            "layers M",
            "outfits",
            "strain of a garment alone [J]",
            "in the outfit [J]",
            "wrong side, each alone [%]",
            "untangled [%]",
            "pairs between garments",
            "clear [%]",
            "post-processed outfits",
            "wrong side then [%]",
            "clear then [%]",
            "strain added, median [%]",
            "post-process per garment [ms], median",
        ],
    )
    .with_note("Wrong side: share of outer vertices within 5 cm of an inner layer that lie under it, by the closest surface point. Clear: no exact pair with the body or between garments, outside of pinched regions.");
    for c in counts {
        order.rows.push(vec![
            format!("M = {}", c.layers),
            c.scenes.to_string(),
            number(c.strain_alone.spread.mean),
            number(c.strain_worn.spread.mean),
            percent(c.wrong_side_single.spread.mean),
            percent(c.wrong_side.spread.mean),
            number(c.layer_pairs.spread.mean),
            percent(c.clear[0]),
            c.resolved.to_string(),
            percent(c.wrong_side_resolved.spread.mean),
            percent(c.clear[1]),
            percent(c.strain_added),
            number(c.post_ms.spread.median),
        ]);
    }
    vec![strain, order]
}
