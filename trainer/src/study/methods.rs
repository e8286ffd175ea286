//! Table 2: the networks beside linear blend skinning, one garment per scene.

use super::estimate::{Estimate, Ratio};
use super::subject::{Measured, Subject};
use super::table::{Table, number, percent};
use crate::drape::DrapeError;
use crate::scene::{SceneDraw, Unseen, in_turn};
use clothcombo_data::asset::Category;
use clothcombo_physics::energy::Term;
use serde::Serialize;
use std::collections::BTreeMap;

/// Names of the methods, in the order in which they are measured.
const METHODS: [&str; 3] = ["LBS of rest", "LBS", "network"];
const NETWORK: usize = METHODS.len() - 1;

/// What scenes are drawn from.
pub struct Question<'a> {
    /// Its number: other numbers are other scenes.
    pub number: usize,
    /// What it is about.
    pub title: String,
    /// Garments, in turn.
    pub pool: &'a [usize],
    /// Poses.
    pub unseen: Unseen,
    /// Number of scenes.
    pub scenes: usize,
}

impl Question<'_> {
    /// Its scenes, one garment each.
    pub fn draws(&self, subject: &Subject) -> Vec<SceneDraw> {
        let draw = |i: usize| {
            let garment = &self.pool[in_turn(i, self.scenes, self.pool.len())..][..1];
            subject.draw([self.number, i], garment, 1, self.unseen)
        };
        if self.pool.is_empty() { Vec::new() } else { (0..self.scenes).map(draw).collect() }
    }
}

/// One method over all scenes.
#[derive(Clone, Debug, Serialize)]
pub struct MethodResult {
    /// Its name.
    pub method: &'static str,
    /// Weighted sum of all energies [J].
    pub total: Estimate,
    /// Energies as they are.
    pub raw: BTreeMap<&'static str, Estimate>,
    /// Energies times their weights [J].
    pub weighted: BTreeMap<&'static str, Estimate>,
    /// Share of vertices inside the body.
    pub inside: Estimate,
    /// Share of vertices deeper than 5 mm.
    pub deeper_than_5mm: Estimate,
    /// Exact pairs of intersecting triangles with the body.
    pub body_pairs: Estimate,
    /// Length of the curves of intersection with the body [mm].
    pub contour_mm: Estimate,
    /// Exact pairs of the garment with itself.
    pub self_pairs: Estimate,
}

impl MethodResult {
    /// Of one measurement per scene.
    pub fn new(method: &'static str, scenes: &[&Measured]) -> Self {
        let over =
            |f: &dyn Fn(&Measured) -> f64| Estimate::of(&scenes.iter().map(|m| f(m)).collect::<Vec<f64>>());
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        let terms = |f: &dyn Fn(&Measured, Term) -> f64| {
            Term::ALL.into_iter().map(|term| (term.name(), over(&|m| f(m, term)))).collect()
        };
        Self {
            method,
            total: over(&|m| m.score.total),
            raw: terms(&|m, term| m.score.raw[term]),
            weighted: terms(&|m, term| m.score.weighted[term]),
            inside: over(&|m| share(m.score.penetration.inside, m.score.penetration.vertices)),
            deeper_than_5mm: over(&|m| share(m.score.penetration.deep, m.score.penetration.vertices)),
            body_pairs: over(&|m| m.body.pairs as f64),
            contour_mm: over(&|m| 1e3 * m.body.contour_length),
            self_pairs: over(&|m| m.own.pairs as f64),
        }
    }
}

/// The networks against one other method.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The other method.
    pub against: &'static str,
    /// Strain.
    pub strain: Ratio,
    /// Weighted collision with the body.
    pub collision: Ratio,
    /// Weighted sum of all energies.
    pub total: Ratio,
}

/// The total of every method on the garments of one category.
#[derive(Clone, Debug, Serialize)]
pub struct CategoryResult {
    /// The category.
    pub category: &'static str,
    /// Per method.
    pub totals: Vec<Estimate>,
    /// Strain of the networks over that of skinning the rest garment.
    pub strain: Ratio,
}

/// Everything about one question.
#[derive(Clone, Debug, Serialize)]
pub struct Methods {
    /// What it is about.
    pub title: String,
    /// Number of scenes.
    pub scenes: usize,
    /// Names of the garments asked for.
    pub garments: Vec<String>,
    /// All methods.
    pub methods: Vec<MethodResult>,
    /// The networks against the others.
    pub comparisons: Vec<Comparison>,
    /// Per category.
    pub categories: Vec<CategoryResult>,
}

/// Asks `question`.
///
/// # Errors
/// When a scene cannot be draped.
pub fn ask(
    subject: &Subject,
    question: &Question<'_>,
    done: &(dyn Fn() + Sync),
) -> Result<Methods, DrapeError> {
    let draws = question.draws(subject);
    let networks = subject.networks();
    let measured = subject.measure(&draws, done, |scene| {
        Ok(vec![networks.skin_rest(scene)?, networks.skin(scene)?, networks.drape(scene)?])
    })?;
    let of = |method: usize, scenes: &[usize]| -> Vec<&Measured> {
        scenes.iter().map(|&i| &measured[i][method]).collect()
    };
    let ratio = |against: usize, scenes: &[usize], f: &dyn Fn(&Measured) -> f64| {
        let values = |method: usize| of(method, scenes).into_iter().map(f).collect::<Vec<f64>>();
        Ratio::of(&values(NETWORK), &values(against))
    };
    let all: Vec<usize> = (0..draws.len()).collect();
    let strain = |m: &Measured| m.score.raw[Term::Strain];
    let category = |i: usize| subject.library.wardrobe.card(draws[i].garments[0]).category;
    let categories = Category::ALL.into_iter().filter_map(|wanted| {
        let scenes: Vec<usize> = all.iter().copied().filter(|&i| category(i) == wanted).collect();
        (!scenes.is_empty()).then(|| CategoryResult {
            category: wanted.name(),
            totals: (0..METHODS.len())
                .map(|m| Estimate::of(&of(m, &scenes).iter().map(|s| s.score.total).collect::<Vec<_>>()))
                .collect(),
            strain: ratio(0, &scenes, &strain),
        })
    });
    Ok(Methods {
        title: question.title.clone(),
        scenes: draws.len(),
        garments: question.pool.iter().map(|&g| subject.library.wardrobe.card(g).name.clone()).collect(),
        methods: METHODS
            .into_iter()
            .enumerate()
            .map(|(m, name)| MethodResult::new(name, &of(m, &all)))
            .collect(),
        comparisons: (0..NETWORK)
            .map(|against| Comparison {
                against: METHODS[against],
                strain: ratio(against, &all, &strain),
                collision: ratio(against, &all, &|m| m.score.weighted[Term::BodyCollision]),
                total: ratio(against, &all, &|m| m.score.total),
            })
            .collect(),
        categories: categories.collect(),
    })
}

/// The paper's Table 2, on data that cannot be had.
const PAPER: [(&str, [&str; 4]); 3] = [
    ("paper: garment-specific network", ["0.737", "0.115", "-0.46", "0.165"]),
    ("paper: ClothCombo", ["0.955", "0.105", "-0.478", "0.62"]),
    ("paper: LBS", ["2.177", "0.072", "-0.463", "222.521"]),
];

impl Methods {
    /// As tables; with the paper's numbers where they answer the same question.
    pub fn tables(&self, with_paper: bool) -> Vec<Table> {
        let mean = |e: &Estimate| {
            format!("{} [{}, {}]", number(e.spread.mean), number(e.interval[0]), number(e.interval[1]))
        };
        let mut means = Table::new(
            format!("{}: energies [J], means over {} scenes [95 % interval]", self.title, self.scenes),
            &["method", "total", "strain", "bending", "gravity", "collision, weighted"],
        );
        let mut spreads = Table::new(
            format!("{}: medians / 95th percentiles [J]", self.title),
            &["method", "total", "strain", "bending", "collision, weighted"],
        );
        let mut contact = Table::new(
            format!("{}: contact", self.title),
            &[
                "method",
                "vertices inside [%]",
                "deeper than 5 mm [%]",
                "pairs with the body",
                "their contour [mm]",
                "pairs with itself",
            ],
        )
        .with_note("Means over the scenes, exact pairs of intersecting triangles; medians in brackets.");
        for m in &self.methods {
            let collision = &m.weighted[Term::BodyCollision.name()];
            let [strain, bending, gravity] =
                [Term::Strain, Term::Bending, Term::Gravity].map(|t| &m.raw[t.name()]);
            let name = m.method.to_owned();
            means.rows.push(
                [vec![name.clone()], [&m.total, strain, bending, gravity, collision].map(mean).to_vec()]
                    .concat(),
            );
            let both = |e: &Estimate| format!("{} / {}", number(e.spread.median), number(e.spread.p95));
            spreads.rows.push(
                [vec![name.clone()], [&m.total, strain, bending, collision].map(both).to_vec()].concat(),
            );
            let shares = [&m.inside, &m.deeper_than_5mm]
                .map(|e| format!("{} ({})", percent(e.spread.mean), percent(e.spread.median)));
            let counts = [&m.body_pairs, &m.contour_mm, &m.self_pairs]
                .map(|e| format!("{} ({})", number(e.spread.mean), number(e.spread.median)));
            contact.rows.push([vec![name], shares.to_vec(), counts.to_vec()].concat());
        }
        for (name, values) in PAPER.into_iter().filter(|_| with_paper) {
            let values = values.map(str::to_owned).to_vec();
            means.rows.push([vec![name.to_owned(), "–".to_owned()], values].concat());
        }
        let mut ratios = Table::new(
            format!("{}: the networks over skinning", self.title),
            &["against", "strain", "strain, medians", "collision, weighted", "total", "total, medians"],
        )
        .with_note("Ratios of means [95 % interval] and of medians over the same scenes; the paper has 0.44 for strain and 1/359 for collision against LBS.");
        for c in &self.comparisons {
            let ratio = |r: &Ratio| {
                format!("{} [{}, {}]", number(r.of_means), number(r.interval[0]), number(r.interval[1]))
            };
            ratios.rows.push(vec![
                c.against.to_owned(),
                ratio(&c.strain),
                number(c.strain.of_medians),
                ratio(&c.collision),
                ratio(&c.total),
                number(c.total.of_medians),
            ]);
        }
        let mut categories = Table::new(
            format!("{}: total [J] by category, mean (median)", self.title),
            &["category", "scenes", METHODS[0], METHODS[1], METHODS[2], "strain over LBS of rest"],
        );
        for c in &self.categories {
            let totals =
                c.totals.iter().map(|e| format!("{} ({})", number(e.spread.mean), number(e.spread.median)));
            let mut row = vec![c.category.to_owned(), c.totals[0].scenes.to_string()];
            row.extend(totals);
            row.push(number(c.strain.of_means));
            categories.rows.push(row);
        }
        vec![means, spreads, contact, ratios, categories]
    }
}
