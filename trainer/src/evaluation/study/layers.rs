//! Table 3: what several layers cost each garment, and what is on the wrong side before and after the post-process.

use super::estimate::{Estimate, Proportion, Ratio};
use super::subject::Subject;
use super::table::{Table, number, percent, percent_with_interval, share_text};
use crate::dataset::{HeldOut, PreparedScene};
use crate::evaluation::certificates::{Counts, Dressing, OutfitResult};
use crate::inference::Draped;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::energy::Term;
use miette::{IntoDiagnostic, Report};
use serde::Serialize;

/// Outfits of one number of layers.
#[derive(Clone, Debug, Serialize)]
pub struct LayerCount {
    /// Number of garments M.
    pub layers: usize,
    /// All of them.
    #[serde(flatten)]
    pub all: Outfits,
    /// Those in an order that can be together.
    pub wearable: Outfits,
}

/// Outfits of as many layers each.
#[derive(Clone, Debug, Serialize)]
pub struct Outfits {
    /// Number of outfits.
    pub scenes: usize,
    /// How many of them went through the post-process.
    pub resolved: usize,
    /// Strain of each layer in the outfit over that of the same garment draped alone, innermost first.
    pub strain: Vec<Ratio>,
    /// Median over the outfits of the ratio of each.
    pub strain_median: Vec<f64>,
    /// Strain of the garments draped alone [J].
    pub strain_alone: Estimate,
    /// Strain of the same garments in the outfit [J].
    pub strain_in_outfit: Estimate,
    /// Share of outer vertices on the wrong side, closest surface point: every garment draped alone.
    pub wrong_side_single: Estimate,
    /// The same after untangling.
    pub wrong_side: Estimate,
    /// The same after the post-process.
    pub wrong_side_resolved: Estimate,
    /// Outfits without an intersection with the body or between garments: all before the post-process, those that went
    /// through it after it.
    pub clear: [Proportion; 2],
    /// Rise of the strain energy by the post-process, median share.
    pub strain_added: f64,
    /// Exact pairs between garments before the post-process.
    pub layer_pairs: Estimate,
    /// Time of the post-process per garment, means of outfits, each on one core [ms].
    pub post_ms: Estimate,
}

/// One outfit.
struct Measured {
    is_wearable: bool,
    /// Strain of every garment draped alone and in the outfit [J].
    strain: Vec<[f64; 2]>,
    /// Share on the wrong side, every garment draped alone.
    wrong_single: f64,
    before: Counts,
    /// If it went through the post-process.
    result: Option<OutfitResult>,
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
    let all: Vec<usize> = (0..subject.dataset.garments.len()).collect();
    let networks = subject.networks();
    let dressing = Dressing::new(&subject.dataset, &subject.config.losses, Some(&networks));
    let measured = |index: usize| -> Result<Measured, Report> {
        let draw = subject.draw([question, index], &all, layers, HeldOut::Windows);
        let scene = subject.prepare(draw)?;
        let drapes = [networks.drape_single_garments(&scene)?, networks.drape(&scene)?];
        let [alone, draped] = drapes.each_ref().map(|drape| dressing.of(&scene, &drape.posed));
        let result =
            (index < resolved).then(|| OutfitResult::new(index, &draped, settings)).transpose()?.map(|r| r.0);
        let measured = Measured {
            is_wearable: draped.is_wearable(),
            strain: strains(&scene, &drapes),
            wrong_single: alone.certificate().into_diagnostic()?.order_violations,
            before: match &result {
                Some(result) => result.before,
                None => draped.counts().into_diagnostic()?,
            },
            result,
        };
        done();
        Ok(measured)
    };
    let outfits = map_single_threaded((0..scenes).collect(), None, measured)?;
    let wearable: Vec<&Measured> = outfits.iter().filter(|outfit| outfit.is_wearable).collect();
    Ok(LayerCount {
        layers,
        all: Outfits::of(layers, &outfits.iter().collect::<Vec<_>>()),
        wearable: Outfits::of(layers, &wearable),
    })
}

impl LayerCount {
    /// What its rows in a table are called, and stand for: a second one where some orders can be worn and some cannot.
    fn rows(&self) -> impl Iterator<Item = (String, &Outfits)> {
        let all = (format!("M = {}", self.layers), &self.all);
        let differs = (1..self.all.scenes).contains(&self.wearable.scenes);
        let wearable = differs.then(|| (format!("M = {}, wearable", self.layers), &self.wearable));
        [all].into_iter().chain(wearable)
    }
}

impl Outfits {
    fn of(layers: usize, outfits: &[&Measured]) -> Self {
        let results: Vec<&OutfitResult> =
            outfits.iter().filter_map(|outfit| outfit.result.as_ref()).collect();
        let of_all = |value: &dyn Fn(&Measured) -> f64| {
            Estimate::of(&outfits.iter().map(|outfit| value(outfit)).collect::<Vec<_>>())
        };
        let of_resolved = |value: &dyn Fn(&OutfitResult) -> f64| {
            Estimate::of(&results.iter().map(|result| value(result)).collect::<Vec<_>>())
        };
        // The garments of an outfit are no independent scenes.
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / layers as f64;
        let [alone, together] = [0, 1].map(|which| {
            let of_layer = |layer: usize| outfits.iter().map(|o| o.strain[layer][which]).collect();
            (0..layers).map(of_layer).collect::<Vec<Vec<f64>>>()
        });
        let ratios = |layer: usize| -> Vec<f64> {
            alone[layer].iter().zip(&together[layer]).map(|(alone, together)| together / alone).collect()
        };
        let added: Vec<f64> = results.iter().filter_map(|r| r.strain_added).collect();
        Self {
            scenes: outfits.len(),
            resolved: results.len(),
            strain: (0..layers).map(|l| Ratio::of(&together[l], &alone[l])).collect(),
            strain_median: (0..layers).map(|l| Estimate::of(&ratios(l)).spread.median).collect(),
            strain_alone: of_all(&|outfit| mean(&mut outfit.strain.iter().map(|s| s[0]))),
            strain_in_outfit: of_all(&|outfit| mean(&mut outfit.strain.iter().map(|s| s[1]))),
            wrong_side_single: of_all(&|outfit| outfit.wrong_single),
            wrong_side: of_all(&|outfit| outfit.before.order_violations),
            wrong_side_resolved: of_resolved(&|result| result.after.order_violations),
            clear: [
                Proportion::new(outfits.iter().map(|outfit| outfit.before.is_clear())),
                Proportion::new(results.iter().map(|result| result.after.is_clear())),
            ],
            strain_added: Estimate::of(&added).spread.median,
            layer_pairs: of_all(&|outfit| outfit.before.layer_triangle_pairs as f64),
            post_ms: of_resolved(&|result| mean(&mut result.milliseconds.iter().copied())),
        }
    }
}

/// Strain of every garment draped alone and in the outfit [J].
fn strains(scene: &PreparedScene, drapes: &[Draped; 2]) -> Vec<[f64; 2]> {
    let energy = &scene.bodies[0].energy;
    let [single, layered] = drapes.each_ref().map(|d| energy.raw(&d.posed, &d.canonical).garments);
    let strain = |raw: &clothcombo_physics::energy::TermMap<Option<f64>>| raw[Term::Strain].unwrap_or(0.0);
    single.iter().zip(&layered).map(|(alone, together)| [strain(alone), strain(together)]).collect()
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
        .with_note("Ratio of means (median of the ratios); after the networks, before the post-process. More than 6 layers were never trained on. Wearable: only the outfits without legs over cloth that hangs between them.");
    for count in counts {
        for (name, outfits) in count.rows() {
            let cells = outfits.strain.iter().zip(&outfits.strain_median);
            let mut row = vec![name];
            row.extend(cells.map(|(r, median)| format!("{} ({})", number(r.of_means), number(*median))));
            strain.rows.push(filled(row));
        }
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
            "clear",
            "post-processed outfits",
            "wrong side then [%]",
            "clear then",
            "strain added, median [%]",
            "post-process per garment [ms], median",
        ],
    )
    .with_note("Wrong side: share of outer vertices within 5 cm of an inner layer that lie under it, by the closest surface point. Clear: no exact pair with the body or between garments, outside of pinched regions. Wearable: the outfits without legs over cloth that hangs between them, which must cross at the crotch. In brackets: 95 % intervals of the mean, and of the share in %. Time: of outfits beside each other, each on one core.");
    for (name, c) in counts.iter().flat_map(LayerCount::rows) {
        let then = |cell: String| if c.resolved == 0 { "–".to_owned() } else { cell };
        order.rows.push(vec![
            name,
            c.scenes.to_string(),
            number(c.strain_alone.spread.mean),
            number(c.strain_in_outfit.spread.mean),
            percent(c.wrong_side_single.spread.mean),
            percent_with_interval(&c.wrong_side),
            number(c.layer_pairs.spread.mean),
            share_text(&c.clear[0]),
            c.resolved.to_string(),
            then(percent_with_interval(&c.wrong_side_resolved)),
            then(share_text(&c.clear[1])),
            then(percent(c.strain_added)),
            then(number(c.post_ms.spread.median)),
        ]);
    }
    vec![strain, order]
}
