//! Pictures: orders, shapes, poses, growing stacks, different garments over the same ones.

use super::subject::Subject;
use crate::dataset::{BodySample, HeldOut, SceneSample};
use crate::evaluation::certificates::Dressing;
use crate::evaluation::samples::picture_of;
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::picture::{LegendEntry, Sheet, SheetRow, View, layer_colour};
use clothcombo_data::asset::{Category, Pose};
use clothcombo_physics::contact::resolve::ResolveSettings;
use image::RgbImage;
use miette::Report;

/// A picture and what it shows.
pub struct Picture {
    /// Name of its file, without ending.
    pub name: &'static str,
    /// One sentence.
    pub caption: String,
    /// The picture.
    pub image: RgbImage,
}

/// Number of pictures.
pub const COUNT: usize = 5;
/// Columns of a sheet.
const COLUMNS: usize = 5;
/// Bodies drawn for them: neighbouring frames of a motion would show the same pose twice.
const CANDIDATES: usize = 8;

struct Studio<'a> {
    subject: &'a Subject,
    networks: &'a Networks<'a>,
    dressing: Dressing<'a>,
    question: usize,
}

/// Draws all galleries, of test garments where there are some of their kind.
///
/// # Errors
/// When a scene cannot be draped or resolved.
pub fn draw(subject: &Subject, question: usize, done: &(dyn Fn() + Sync)) -> Result<Vec<Picture>, Report> {
    let networks = &subject.networks();
    let dressing = Dressing::new(&subject.dataset, &subject.config.losses, Some(networks));
    let studio = Studio { subject, networks, dressing, question };
    let shirt = |n| subject.pick(&[Category::TShirt, Category::Top], n);
    let legs = |n| subject.pick(&[Category::Trousers, Category::Skirt], n);
    let skirt = |n| subject.pick(&[Category::Skirt, Category::Dress], n);
    let over = |n| subject.pick(&[Category::OpenShirt, Category::Dress], n);
    let three = [shirt(0), skirt(0), over(0)];
    let t_pose = Pose::t_pose(subject.dataset.body.joint_count());
    let mean = BodySample { shape: vec![0.0; subject.dataset.shape_count], pose: t_pose };
    let mut pictures = Vec::with_capacity(COUNT);
    let mut add = |name, caption: &str, image| {
        pictures.push(Picture { name, caption: caption.to_owned(), image });
        done();
    };

    let [a, b, c] = three;
    let orders = [[a, b, c], [a, c, b], [b, a, c], [b, c, a], [c, a, b]];
    let cells = orders.map(|order| (order.to_vec(), mean.clone()));
    // Numbered as the legend lists them.
    let number = |g| three.iter().position(|other| *other == g).map_or(0, |i| i + 1).to_string();
    let columns = orders.map(|order| order.map(number).join(" < "));
    add(
        "orders",
        "The same three garments in different orders, inner to outer; numbers as in the legend.",
        studio.sheet(&cells, &columns)?,
    );

    let bodies = unlike((0..CANDIDATES).map(|i| studio.body(i)).collect());
    let cells = bodies.iter().map(|b| (three.to_vec(), BodySample { pose: mean.pose.clone(), ..b.clone() }));
    let numbers: Vec<String> = (1..=COLUMNS).map(|i| format!("body {i}")).collect();
    add(
        "shapes",
        "The same outfit on bodies of random shape.",
        studio.sheet(&cells.collect::<Vec<_>>(), &numbers)?,
    );

    let cells =
        bodies.iter().map(|b| (three.to_vec(), BodySample { shape: mean.shape.clone(), ..b.clone() }));
    let numbers: Vec<String> = (1..=COLUMNS).map(|i| format!("pose {i}")).collect();
    add(
        "poses",
        "The same outfit in poses of held-out windows.",
        studio.sheet(&cells.collect::<Vec<_>>(), &numbers)?,
    );

    let stack = [legs(0), shirt(0), skirt(0), over(0), over(1)];
    let pose = bodies[0].clone();
    let cells: Vec<_> = (1..=COLUMNS).map(|n| (stack[..n].to_vec(), pose.clone())).collect();
    let numbers: Vec<String> =
        (1..=COLUMNS).map(|n| if n == 1 { "1 layer".into() } else { format!("{n} layers") }).collect();
    add("layers", "Garments put on one after the other.", studio.sheet(&cells, &numbers)?);

    let cells: Vec<_> = (0..COLUMNS)
        .map(|n| {
            (vec![legs(0), shirt(0), if n % 2 == 0 { over(n / 2) } else { skirt(n / 2) }], bodies[1].clone())
        })
        .collect();
    let numbers: Vec<String> = (1..=COLUMNS).map(|n| format!("outer garment {n}")).collect();
    add("outer", "Different garments over the same two.", studio.sheet(&cells, &numbers)?);
    Ok(pictures)
}

/// As many bodies as a sheet has columns: the first one, then always that whose pose is least like those before.
fn unlike(mut bodies: Vec<BodySample>) -> Vec<BodySample> {
    let difference = |a: &BodySample, b: &BodySample| -> f64 {
        let turned = a.pose.rotations.iter().flatten().zip(b.pose.rotations.iter().flatten());
        turned.map(|(a, b)| (a - b) * (a - b)).sum()
    };
    for taken in 1..COLUMNS.min(bodies.len()) {
        let (chosen, others) = bodies.split_at(taken);
        let least = |b: &BodySample| chosen.iter().map(|c| difference(c, b)).fold(f64::INFINITY, f64::min);
        let farthest = (0..others.len()).max_by(|a, b| least(&others[*a]).total_cmp(&least(&others[*b])));
        bodies.swap(taken, taken + farthest.unwrap_or(0));
    }
    bodies.truncate(COLUMNS);
    bodies
}

impl Subject {
    /// The `n`-th garment of the first of `categories` that has one: test garments come first, then validation garments. Garment 0 where
    /// there is none of them.
    fn pick(&self, categories: &[Category], n: usize) -> usize {
        let split = &self.dataset.split;
        let all = || split.test.iter().chain(&split.validation).chain(&split.training).copied();
        let of = |category: &Category| {
            let garments = &self.dataset.garments;
            all().filter(|&g| garments.info(g).category == *category).collect::<Vec<usize>>()
        };
        let found = categories.iter().map(of).find(|garments| !garments.is_empty()).unwrap_or_default();
        found.get(n % found.len().max(1)).copied().unwrap_or(0)
    }
}

impl Studio<'_> {
    fn body(&self, index: usize) -> BodySample {
        let at = [self.question, index];
        self.subject.draw(at, &[0], 1, HeldOut::Windows).bodies.remove(0)
    }

    /// Outfits from left to right; seen from the front, then from the back. Where all of them hold the same garments a colour
    /// stands for a garment, otherwise for a layer.
    fn sheet(&self, outfits: &[(Vec<usize>, BodySample)], columns: &[String]) -> Result<RgbImage, Report> {
        let mut rows = [View::ThreeQuarter, View::Back]
            .map(|view| SheetRow { label: view.name().to_owned(), ..SheetRow::default() });
        // The first of them: legend and numbers follow its order.
        let longest =
            outfits.iter().rev().map(|(garments, _)| garments).max_by_key(|garments| garments.len());
        let same = longest.filter(|all| {
            outfits.iter().all(|(o, _)| o.len() == all.len() && o.iter().all(|g| all.contains(g)))
        });
        for (garments, body) in outfits {
            let place = |layer: usize| {
                let found = same.and_then(|all| all.iter().position(|g| *g == garments[layer]));
                layer_colour(found.unwrap_or(layer))
            };
            let [front, back] = self.views(garments, body, &place)?;
            rows[0].cells.push(front);
            rows[1].cells.push(back);
        }
        // Names are given where a colour means the same garment all along.
        let garments = &self.subject.dataset.garments;
        let grows = |all: &Vec<usize>| outfits.iter().all(|(garments, _)| all.starts_with(garments));
        rows[0].legend = longest
            .filter(|all| same.is_some() || grows(all))
            .into_iter()
            .flatten()
            .enumerate()
            .map(|(i, &g)| LegendEntry { colour: layer_colour(i), name: garments.info(g).name.clone() })
            .collect();
        Ok(Sheet { title: String::new(), columns: columns.to_vec(), rows: rows.to_vec() }.compose())
    }

    /// An outfit draped and resolved.
    fn views(
        &self,
        garments: &[usize],
        body: &BodySample,
        colour: &dyn Fn(usize) -> [u8; 3],
    ) -> Result<[RgbImage; 2], Report> {
        let draw =
            SceneSample { garments: garments.to_vec(), bodies: vec![body.clone()], repulsion_sample: 0 };
        let scene = self.subject.prepare(draw)?;
        let draped = self.networks.drape(&scene)?;
        let resolved = self.dressing.of(&scene, &draped.posed).resolved(&ResolveSettings::default())?;
        let posed = resolved.positions.concat().into_iter().map(|p| p.map(|v| v as f32)).collect();
        let draped = Draped { posed, ..draped };
        Ok([View::ThreeQuarter, View::Back].map(|view| picture_of(&scene, &draped, view, colour)))
    }
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
