//! Table 2: the networks beside linear blend skinning, one garment per scene.

use super::estimate::{Estimate, Ratio};
use super::sets::DataSet;
use super::subject::{Measured, PAPER_COLLISION, Subject};
use super::table::{Table, mean_and_median, mean_with_interval, number, percent, ratio_with_interval};
use crate::dataset::{Dataset, SceneSample, round_robin};
use crate::inference::tensor_store::DrapeError;
use clothcombo_data::asset::Category;
use clothcombo_physics::energy::Term;
use serde::Serialize;
use std::collections::BTreeMap;

/// Names of the methods, in the order in which they are measured.
const METHODS: [&str; 3] = ["LBS of rest", "LBS", "network"];
const NETWORK: usize = METHODS.len() - 1;

/// What scenes are drawn from.
pub struct Question {
    /// Its number: other numbers are other scenes.
    pub number: usize,
    /// The garments, in turn, and the poses.
    pub set: DataSet,
    /// The garments as indices into the wardrobe; not empty.
    pub pool: Vec<usize>,
    /// Number of scenes.
    pub scenes: usize,
}

impl Question {
    /// `scenes` scenes of `set`; none where the data has no such garments or poses.
    pub fn new(number: usize, set: DataSet, scenes: usize, dataset: &Dataset) -> Option<Self> {
        let pool = set.pool(dataset);
        (!pool.is_empty() && scenes > 0).then_some(Self { number, set, pool, scenes })
    }

    /// Its scenes, one garment each.
    pub fn draws(&self, subject: &Subject) -> Vec<SceneSample> {
        let draw = |i: usize| {
            let garment = &self.pool[round_robin(i, self.scenes, self.pool.len())..][..1];
            subject.draw([self.number, i], garment, 1, self.set.poses)
        };
        (0..self.scenes).map(draw).collect()
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
    /// Collision with the body in the paper's form: weight 250, ε = 2 mm, not scaled with the number of vertices.
    pub paper_collision: Estimate,
    /// Collision between garments in the same form, over every two garments.
    pub paper_layer_collision: Estimate,
    /// The paper's degree of self-collision ([`clothcombo_physics::contact::self_collision`]).
    pub self_collision: Estimate,
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
            paper_collision: over(&|m| m.paper_collision),
            paper_layer_collision: over(&|m| m.paper_layer_collision),
            self_collision: over(&|m| m.self_collision),
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
    /// The same in the paper's form.
    pub paper_collision: Ratio,
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
    /// The garments and poses.
    pub set: DataSet,
    /// Number of scenes.
    pub scenes: usize,
    /// Weight and margin of the collision as the model's configuration has it.
    pub collision: String,
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
pub fn ask(subject: &Subject, question: &Question, done: &(dyn Fn() + Sync)) -> Result<Methods, DrapeError> {
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
    let category = |i: usize| subject.dataset.garments.info(draws[i].garments[0]).category;
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
        title: question.set.title(&subject.dataset),
        set: question.set,
        scenes: draws.len(),
        collision: subject.collision_form(Term::BodyCollision),
        garments: question.pool.iter().map(|&g| subject.dataset.garments.info(g).name.clone()).collect(),
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
                paper_collision: ratio(against, &all, &|m| m.paper_collision),
                total: ratio(against, &all, &|m| m.score.total),
            })
            .collect(),
        categories: categories.collect(),
    })
}

/// The paper's Table 2, on data that cannot be had: strain, bending, gravity, collision.
const PAPER: [(&str, [&str; 4]); 3] = [
    ("paper: SNUG, one model per garment", ["0.737", "0.115", "-0.46", "0.165"]),
    ("paper: ClothCombo", ["0.955", "0.105", "-0.478", "0.62"]),
    ("paper: LBS", ["2.177", "0.072", "-0.463", "222.521"]),
];

/// One row per set: what is quoted.
pub fn summary(sets: &[Methods]) -> Table {
    let collision = sets.first().map_or("", |set| set.collision.as_str());
    let mut table = Table::new(
        "The networks on every set, against LBS of rest",
        &[
            "set",
            "garments",
            "scenes",
            "strain [J]",
            "total [J]",
            "strain over LBS of rest",
            "of medians",
            &format!("collision over it ({collision})"),
            &format!("collision over it ({PAPER_COLLISION})"),
            "deeper than 5 mm [%]",
        ],
    )
    .with_note(
        "Means over the scenes [95 % interval of the mean] (median); ratios of means [95 % interval]. The intervals are over scenes, not over \
         garments: those of a set of few garments do not tell how much other garments would change.",
    );
    for set in sets {
        let (Some(network), Some(against)) = (set.methods.get(NETWORK), set.comparisons.first()) else {
            continue;
        };
        let cell = |e: &Estimate| format!("{} ({})", mean_with_interval(e), number(e.spread.median));
        table.rows.push(vec![
            set.title.clone(),
            set.garments.len().to_string(),
            set.scenes.to_string(),
            cell(&network.raw[Term::Strain.name()]),
            cell(&network.total),
            ratio_with_interval(&against.strain),
            number(against.strain.of_medians),
            ratio_with_interval(&against.collision),
            ratio_with_interval(&against.paper_collision),
            percent(network.deeper_than_5mm.spread.mean),
        ]);
    }
    table
}

impl Methods {
    /// As tables; with the paper's numbers where they answer the same question.
    pub fn tables(&self, with_paper: bool) -> Vec<Table> {
        let own = format!("collision ({})", self.collision);
        let paper = format!("collision ({PAPER_COLLISION})");
        let mut means = Table::new(
            format!("{}: energies [J], means over {} scenes [95 % interval]", self.title, self.scenes),
            &["method", "total", "strain", "bending", "gravity", &own, &paper],
        );
        let mut spreads = Table::new(
            format!("{}: medians / 95th percentiles [J]", self.title),
            &["method", "total", "strain", "bending", &own, &paper],
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
            let collisions = [&m.weighted[Term::BodyCollision.name()], &m.paper_collision];
            let [strain, bending, gravity] =
                [Term::Strain, Term::Bending, Term::Gravity].map(|t| &m.raw[t.name()]);
            let row = |first: &[&Estimate], cell: &dyn Fn(&Estimate) -> String| -> Vec<String> {
                let cells = first.iter().copied().chain(collisions).map(cell);
                [m.method.to_owned()].into_iter().chain(cells).collect()
            };
            means.rows.push(row(&[&m.total, strain, bending, gravity], &mean_with_interval));
            let both = |e: &Estimate| format!("{} / {}", number(e.spread.median), number(e.spread.p95));
            spreads.rows.push(row(&[&m.total, strain, bending], &both));
            let shares = [&m.inside, &m.deeper_than_5mm]
                .map(|e| format!("{} ({})", percent(e.spread.mean), percent(e.spread.median)));
            let counts = [&m.body_pairs, &m.contour_mm, &m.self_pairs].map(mean_and_median);
            contact.rows.push([vec![m.method.to_owned()], shares.to_vec(), counts.to_vec()].concat());
        }
        for (name, [strain, bending, gravity, collision]) in PAPER.into_iter().filter(|_| with_paper) {
            means
                .rows
                .push([name, "–", strain, bending, gravity, "–", collision].map(str::to_owned).to_vec());
        }
        let mut ratios = Table::new(
            format!("{}: the networks over skinning", self.title),
            &["against", "strain", "strain, medians", &own, &paper, "total", "total, medians"],
        )
        .with_note(
            "Ratios of means [95 % interval] and of medians over the same scenes; the paper has 0.44 for strain and 1/359 for collision, in its \
             own form, against LBS.",
        );
        for c in &self.comparisons {
            ratios.rows.push(vec![
                c.against.to_owned(),
                ratio_with_interval(&c.strain),
                number(c.strain.of_medians),
                ratio_with_interval(&c.collision),
                ratio_with_interval(&c.paper_collision),
                ratio_with_interval(&c.total),
                number(c.total.of_medians),
            ]);
        }
        let mut categories = Table::new(
            format!("{}: total [J] by category, mean (median)", self.title),
            &["category", "scenes", METHODS[0], METHODS[1], METHODS[2], "strain over LBS of rest"],
        );
        for c in &self.categories {
            let mut row = vec![c.category.to_owned(), c.totals[0].scenes.to_string()];
            row.extend(c.totals.iter().map(mean_and_median));
            row.push(number(c.strain.of_means));
            categories.rows.push(row);
        }
        vec![means, spreads, contact, ratios, categories]
    }
}
