//! The certificates of random outfits in clips that were not trained on, before and after the post-process.

use super::layers::AFTER_POST_PROCESS;
use super::post_processor::DrapedScene;
use super::{Estimate, Evaluator, Proportion, Section, Table};
use crate::dataset::{HeldOut, PreparedScene};
use crate::inference::UniqueNames;
use crate::run::report::table::{Column, median_and_p95, percent, percent_and_median, plain, proportion};
use crate::system::single_threaded::map_single_threaded;
use clothcombo_data::format::obj;
use clothcombo_physics::contact::resolve::{Certificate, ResolveSettings, Resolved};
use miette::{IntoDiagnostic, Report, WrapErr};
use serde_json::{Value, json};
use std::path::Path;

/// Random stream of the outfits.
const OUTFIT_STREAM: usize = 15;
/// Outfits have 1 to so many garments, one more from each to the next.
const MOST_OUTFIT_LAYERS: usize = 6;
/// A body with fewer pairs in pinched regions before the post-process is called hardly pinched.
const HARDLY_PINCHED: usize = 200;

struct PostProcessedOutfit {
    /// Names, inner → outer.
    garments: Vec<String>,
    is_feasible: bool,
    before: Certificate,
    after: Resolved,
}

/// The post-process as `clothcombo drape` runs it, on as many outfits as were asked for; no section without them.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let indices: Vec<usize> = (0..evaluator.counts.outfits).collect();
    if indices.is_empty() {
        return Ok(Vec::new());
    }
    let outfits = map_single_threaded(indices, |index| {
        let outfit = resolved(evaluator, index).wrap_err_with(|| format!("outfit {index}"));
        evaluator.scene_done();
        outfit
    })?;
    let rows = statistics(&outfits);
    let columns: [Column<'_>; 8] = [
        ("outfits", "/name", plain),
        ("number", "/outfits", plain),
        ("intersection-free", "/intersection_free/0", proportion),
        ("then", "/intersection_free/1", proportion),
        ("layer-order violations then [%]", "/after/order_violations/mean", percent),
        ("strain added [%]", "/strain_added", percent_and_median),
        ("post-process per garment [ms]", "/after/milliseconds", median_and_p95),
        ("self-intersecting then", "/self_intersecting", proportion),
    ];
    let table = Table::new("Random outfits before and after the post-process", &rows, &columns).with_note(format!(
        "Intersection-free and feasible: as in Table 3. On a hardly pinched body fewer than {HARDLY_PINCHED} pairs lie in pinched regions \
         before the post-process. Strain added: mean (median). Time: median (95th percentile), outfits in parallel, each on one thread."
    ));
    let text = "Garments of all sets in random order, in validation clips (held-out windows where there are none), on bodies of random shape.";
    let numbers = json!({ "groups": rows, "outfits": outfits.iter().map(PostProcessedOutfit::numbers).collect::<Vec<_>>() });
    Ok(vec![Section::new("certificates", "Certificates of random outfits", text, numbers, vec![table])])
}

/// Drapes and resolves outfit `index`. Test clips stay unread: the post-process is tuned on these outfits.
fn resolved(evaluator: &Evaluator<'_>, index: usize) -> Result<PostProcessedOutfit, Report> {
    let Evaluator { model, networks, post_process, meshes, .. } = evaluator;
    let clips = HeldOut::ValidationClips;
    let poses = if model.dataset.poses.has(clips) { clips } else { HeldOut::Windows };
    let sample =
        model.sample([OUTFIT_STREAM, index], &model.garments(), 1 + index % MOST_OUTFIT_LAYERS, poses);
    let scene = model.prepare(&sample)?;
    let draped = post_process.of(&scene, &networks.drape(&scene)?.posed);
    let outfit = PostProcessedOutfit {
        garments: model.names(&sample.garments),
        is_feasible: draped.is_feasible(),
        before: draped.certificate().into_diagnostic()?,
        after: draped.resolved(&ResolveSettings::default())?,
    };
    if let Some(folder) = meshes {
        save_meshes(&folder.join(format!("{index:04}")), &scene, &draped, &outfit.after.positions)?;
    }
    Ok(outfit)
}

impl PostProcessedOutfit {
    fn numbers(&self) -> Value {
        let [before, after] = [&self.before, &self.after.certificate]
            .map(|certificate| Certificate { remaining: Vec::new(), ..certificate.clone() });
        json!({
            "garments": self.garments,
            "is_feasible": self.is_feasible,
            "before": before,
            "after": after,
            "milliseconds": self.after.garments.iter().map(|g| 1e3 * g.time.as_secs_f64()).collect::<Vec<_>>(),
        })
    }
}

/// Of outfits by their number of garments, of all, and of those that a post-process can be expected to clear.
fn statistics(outfits: &[PostProcessedOutfit]) -> Vec<Value> {
    let row = |name: String, belongs: &dyn Fn(&PostProcessedOutfit) -> bool| {
        let chosen: Vec<&PostProcessedOutfit> = outfits.iter().filter(|outfit| belongs(outfit)).collect();
        let after: Vec<&Resolved> = chosen.iter().map(|outfit| &outfit.after).collect();
        json!({
            "name": name,
            "outfits": chosen.len(),
            "intersection_free": [
                Proportion::new(chosen.iter().map(|outfit| outfit.before.is_clear())),
                Proportion::new(after.iter().map(|resolved| resolved.certificate.is_clear())),
            ],
            "self_intersecting": Proportion::new(after.iter().map(|r| r.certificate.self_triangle_pairs > 0)),
            "after": Estimate::of_metrics(&after, &AFTER_POST_PROCESS),
            // Rise of the strain energy by the post-process, as a share.
            "strain_added": Estimate::of(after.iter().filter_map(|r| r.certificate.strain_added)),
        })
    };
    let by_count = (1..=MOST_OUTFIT_LAYERS).map(|count| {
        let name = format!("{count} garment{}", if count == 1 { "" } else { "s" });
        row(name, &|outfit| outfit.garments.len() == count)
    });
    let groups = [
        row("all".into(), &|_| true),
        row("feasible orders".into(), &|outfit| outfit.is_feasible),
        row("on a hardly pinched body".into(), &|outfit| outfit.before.pinched.count() < HARDLY_PINCHED),
    ];
    by_count.chain(groups).filter(|row| row["outfits"] != 0).collect()
}

/// Writes the body and the garments at rest, draped and `resolved` as OBJ files.
fn save_meshes(
    folder: &Path,
    scene: &PreparedScene,
    draped: &DrapedScene<'_>,
    resolved: &[Vec<[f64; 3]>],
) -> Result<(), Report> {
    let save = |file: String, positions: &[[f64; 3]], faces: &[[u32; 3]], note: String| {
        obj::save(&folder.join(file), positions, faces, &[note]).into_diagnostic()
    };
    save("body.obj".into(), &draped.body.positions, &draped.body.faces, "body".into())?;
    let mut names = UniqueNames::default();
    for (i, garment) in scene.garments.iter().enumerate() {
        let garment = &garment.garment;
        let name = names.take(&garment.name);
        let states = [
            ("rest", garment.rest.positions()),
            ("draped", &draped.positions[i]),
            ("resolved", &resolved[i]),
        ];
        for (state, positions) in states {
            let note = format!("{}: {} {}", garment.name, garment.source.author, garment.source.licence);
            save(format!("{state}/{i}-{name}.obj"), positions, garment.rest.faces(), note)?;
        }
    }
    Ok(())
}
