//! Pictures: orders, shapes, poses, growing stacks, different garments over the same ones.

use super::page::Picture;
use super::sample_picture::picture_of;
use super::{Evaluator, ModelUnderTest, Section};
use crate::dataset::{BodySample, HeldOut, PreparedScene, SceneSample};
use crate::inference::reference::ReferenceScene;
use crate::inference::{Draped, RefineSteps, refine};
use crate::picture::{LegendEntry, PictureSheet, SheetRow, View, layer_colour, png_bytes};
use clothcombo_data::asset::{Category, Pose};
use clothcombo_physics::contact::resolve::ResolveSettings;
use image::RgbImage;
use miette::{IntoDiagnostic, Report};
use serde_json::Value;

/// Number of pictures.
pub const PICTURE_COUNT: usize = 5;
/// Columns of a sheet.
const SHEET_COLUMNS: usize = 5;
/// Bodies sampled for them: neighbouring frames of a motion would show the same pose twice.
const CANDIDATES: usize = 8;

const GALLERY_VIEWS: [View; 2] = [View::ThreeQuarter, View::Back];

/// A garment by its index on every layer, and the body.
type Outfit = (Vec<usize>, BodySample);

pub fn picture_count(evaluator: &Evaluator<'_>) -> usize {
    if evaluator.counts.gallery { PICTURE_COUNT } else { 0 }
}

/// All galleries, of test garments where there are some of their kind.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    if !evaluator.counts.gallery {
        return Ok(Vec::new());
    }
    let model = evaluator.model;
    let legs = |n| model.pick(&[Category::Trousers, Category::Skirt], n);
    let skirt = |n| model.pick(&[Category::Skirt, Category::Dress], n);
    let shirt = shirt_over(model, skirt(0))?;
    let over = |n| model.pick(&[Category::OpenShirt, Category::Dress], n);
    let t_pose = Pose::t_pose(model.dataset.body.joint_count());
    let mean = BodySample { shape: vec![0.0; model.dataset.shape_count], pose: t_pose };
    let body = |i: usize| model.sample([9, i], &[0], 1, HeldOut::Windows).bodies.remove(0);
    let bodies = unlike((0..CANDIDATES).map(body).collect());
    let in_t_pose = |b: &BodySample| BodySample { pose: mean.pose.clone(), ..b.clone() };
    let of_mean_shape = |b: &BodySample| BodySample { shape: mean.shape.clone(), ..b.clone() };
    let three @ [a, b, c] = [shirt, skirt(0), over(0)];
    let orders = [[a, b, c], [a, c, b], [b, a, c], [b, c, a], [c, a, b]];
    // Numbered as the legend lists them.
    let number = |g| three.iter().position(|other| *other == g).map_or(0, |i| i + 1).to_string();
    let stack = [legs(0), shirt, skirt(0), over(0), over(1)];
    let outer = |n: usize| if n.is_multiple_of(2) { over(n / 2) } else { skirt(n / 2) };
    let numbered = |what: &str| (1..=SHEET_COLUMNS).map(|i| format!("{what} {i}")).collect::<Vec<_>>();

    let sheets: [(_, _, Vec<String>, Vec<Outfit>); PICTURE_COUNT] = [
        (
            "orders",
            "The same three garments in different orders, inner to outer; numbers as in the legend.",
            orders.map(|order| order.map(number).join(" < ")).to_vec(),
            orders.map(|order| (order.to_vec(), mean.clone())).to_vec(),
        ),
        (
            "shapes",
            "The same outfit on bodies of random shape.",
            numbered("body"),
            bodies.iter().map(|b| (three.to_vec(), in_t_pose(b))).collect(),
        ),
        (
            "poses",
            "The same outfit in poses of held-out windows.",
            numbered("pose"),
            bodies.iter().map(|b| (three.to_vec(), of_mean_shape(b))).collect(),
        ),
        (
            "layers",
            "Garments put on one after the other.",
            (1..=SHEET_COLUMNS)
                .map(|n| if n == 1 { "1 layer".into() } else { format!("{n} layers") })
                .collect(),
            (1..=SHEET_COLUMNS).map(|n| (stack[..n].to_vec(), bodies[0].clone())).collect(),
        ),
        (
            "outer",
            "Different garments over the same two.",
            numbered("outer garment"),
            (0..SHEET_COLUMNS).map(|n| (vec![legs(0), shirt, outer(n)], bodies[1].clone())).collect(),
        ),
    ];
    let picture = |(name, caption, columns, outfits): (&str, &str, _, Vec<Outfit>)| {
        let png = png_bytes(&sheet(evaluator, &outfits, columns)?).into_diagnostic()?;
        evaluator.scene_done();
        Ok::<_, Report>(Picture { file: format!("{name}.png"), caption: caption.to_owned(), png, html: None })
    };
    let text = "After post-process and refinement. Names in the legend stand for garments, colours without names for layers from inner to outer.";
    let mut section = Section::new("gallery", "Gallery", text, Value::Null, Vec::new());
    section.pictures = sheets.into_iter().map(picture).collect::<Result<_, _>>()?;
    Ok(vec![section])
}

/// As many bodies as a sheet has columns: the first one, then always that whose pose is least like those before.
fn unlike(mut bodies: Vec<BodySample>) -> Vec<BodySample> {
    let difference = |a: &BodySample, b: &BodySample| -> f64 {
        let turned = a.pose.rotations.iter().flatten().zip(b.pose.rotations.iter().flatten());
        turned.map(|(a, b)| (a - b) * (a - b)).sum()
    };
    for taken in 1..SHEET_COLUMNS.min(bodies.len()) {
        let (chosen, others) = bodies.split_at(taken);
        let least = |b: &BodySample| chosen.iter().map(|c| difference(c, b)).fold(f64::INFINITY, f64::min);
        let farthest = (0..others.len()).max_by(|a, b| least(&others[*a]).total_cmp(&least(&others[*b])));
        bodies.swap(taken, taken + farthest.unwrap_or(0));
    }
    bodies.truncate(SHEET_COLUMNS);
    bodies
}

impl ModelUnderTest {
    /// The `n`-th garment of the first of `categories` that has one: test garments come first, then validation
    /// garments. Garment 0 where there is none of them.
    fn pick(&self, categories: &[Category], n: usize) -> usize {
        let found = categories.iter().map(|category| self.all_of(*category));
        let found = found.into_iter().find(|garments| !garments.is_empty()).unwrap_or_default();
        found.get(n % found.len().max(1)).copied().unwrap_or(0)
    }

    /// All garments of `category`, those of the test set first, then those of validation.
    fn all_of(&self, category: Category) -> Vec<usize> {
        let split = &self.dataset.split;
        let all = split.test.iter().chain(&split.validation).chain(&split.training).copied();
        all.filter(|&g| self.dataset.garments.info(g).category == category).collect()
    }
}

/// Of the T-shirts and tops, test garments where there are some, the shortest one that reaches below the upper rim of `skirt`: a
/// thigh that is raised lifts a skirt's hem above that of a long shirt, which then seems to be worn over it.
fn shirt_over(model: &ModelUnderTest, skirt: usize) -> Result<usize, Report> {
    let heights = |g: usize| {
        let (low, high) = model.dataset.garments.garment(g)?.garment.rest.bounds();
        Ok::<_, Report>([low[1], high[1]])
    };
    let is_test = |g: &usize| model.dataset.split.test.contains(g);
    let mut shirts = model.all_of(Category::TShirt);
    shirts.extend(model.all_of(Category::Top));
    if shirts.iter().any(is_test) {
        shirts.retain(is_test);
    }
    let rim = heights(skirt)?[1];
    let hems =
        shirts.iter().map(|&shirt| Ok((heights(shirt)?[0], shirt))).collect::<Result<Vec<_>, Report>>()?;
    let shortest = hems.iter().filter(|(hem, _)| *hem < rim).max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(shortest.or(hems.first()).map_or(0, |(_, shirt)| *shirt))
}

/// Outfits from left to right; seen from the front, then from the back. Where all of them hold the same garments a colour
/// stands for a garment, otherwise for a layer.
fn sheet(evaluator: &Evaluator<'_>, outfits: &[Outfit], columns: Vec<String>) -> Result<RgbImage, Report> {
    let mut rows =
        GALLERY_VIEWS.map(|view| SheetRow { label: view.name().to_owned(), ..SheetRow::default() });
    // The first of them: legend and numbers follow its order.
    let longest = outfits.iter().rev().map(|(garments, _)| garments).max_by_key(|garments| garments.len());
    let same = longest
        .filter(|all| outfits.iter().all(|(o, _)| o.len() == all.len() && o.iter().all(|g| all.contains(g))));
    for (garments, body) in outfits {
        let colour = |layer: usize| {
            let found = same.and_then(|all| all.iter().position(|g| *g == garments[layer]));
            layer_colour(found.unwrap_or(layer))
        };
        let (scene, draped) = finished(evaluator, garments, body)?;
        for (row, view) in rows.iter_mut().zip(GALLERY_VIEWS) {
            row.cells.push(picture_of(&scene, &draped, view, &colour));
        }
    }
    // Names are given where a colour means the same garment all along.
    let grows = |all: &Vec<usize>| outfits.iter().all(|(garments, _)| all.starts_with(garments));
    let named = longest.filter(|all| same.is_some() || grows(all));
    let names = evaluator.model.names(named.map_or(&[], Vec::as_slice));
    let entry = |(i, name)| LegendEntry { colour: layer_colour(i), name };
    rows[0].legend = names.into_iter().enumerate().map(entry).collect();
    Ok(PictureSheet { title: String::new(), columns, rows: rows.to_vec() }.compose())
}

/// An outfit draped, resolved and refined.
fn finished(
    evaluator: &Evaluator<'_>,
    garments: &[usize],
    body: &BodySample,
) -> Result<(PreparedScene, Draped), Report> {
    let sample = SceneSample {
        garments: garments.to_vec(),
        below: Vec::new(),
        bodies: vec![body.clone()],
        repulsion_sample: 0,
    };
    let scene = evaluator.model.prepare(&sample)?;
    let draped = evaluator.networks.drape(&scene)?;
    let resolved = evaluator.post_process.of(&scene, &draped.posed).resolved(&ResolveSettings::default())?;
    let reference = ReferenceScene::new(&evaluator.model.config.losses, &scene).into_diagnostic()?;
    let (refined, _) = refine(&reference.energy, &resolved.positions.concat(), RefineSteps::default_of(1))
        .into_diagnostic()?;
    let posed = refined.into_iter().map(|p| p.map(|v| v as f32)).collect();
    Ok((scene, Draped { posed, ..draped }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_of_a_sheet_are_in_unlike_poses() {
        let body = |angle: f64| BodySample {
            shape: vec![angle],
            pose: Pose { rotations: vec![[0.0; 3], [angle, 0.0, 0.0]] },
        };
        let chosen = unlike([0.0, 0.01, 0.5, 0.02, 1.0, 0.03, 0.25, 0.75].map(body).to_vec());
        let mut angles: Vec<f64> = chosen.iter().map(|b| b.shape[0]).collect();
        assert_eq!(angles[..3], [0.0, 1.0, 0.5]);
        angles.sort_by(f64::total_cmp);
        assert_eq!(angles, [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(unlike(vec![body(0.3)]).len(), 1);
    }
}
