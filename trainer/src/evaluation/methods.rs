//! Table 2: the networks against linear blend skinning, one garment per scene.

use super::table::{mean_and_median, mean_with_interval, percent_and_median, ratio_with_interval};
use super::{
    DrapeMetrics, Estimate, Evaluator, GarmentSet, MethodResult, Metric, PAPER_COLLISION, Ratio, SceneSet,
    Scenes, Section, Table, drape_by, number, percent,
};
use crate::dataset::HeldOut;
use crate::inference::tensor_store::DrapeError;
use crate::run::validation::Method;
use clothcombo_data::asset::Category;
use clothcombo_physics::energy::Term;
use miette::Report;
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;

/// The methods, in the order in which they are measured.
const METHODS: [Method; 3] = [Method::Lbs, Method::LbsWithShapeTransfer, Method::Network];
const NETWORK: usize = METHODS.len() - 1;

/// Every set by itself, since only the last ones were read by no run. Random streams stay with their set, so that its scenes stay
/// the same.
fn scenes(evaluator: &Evaluator<'_>) -> Vec<Scenes> {
    use GarmentSet::{IndependentTest, Test, Training, Validation};
    use HeldOut::{TestClips, ValidationClips, Windows};
    let counts = &evaluator.counts;
    let sets = [
        (0, Training, Windows, counts.single_garments),
        (1, Training, ValidationClips, counts.clips),
        (10, Training, TestClips, counts.clips),
        (11, Validation, Windows, counts.validation_garments),
        (2, Test, Windows, counts.test_garments),
        (12, IndependentTest, Windows, counts.independent_garments),
        (13, Test, TestClips, counts.test_garments),
    ];
    Scenes::of(evaluator, &sets)
}

pub fn scene_count(evaluator: &Evaluator<'_>) -> usize {
    scenes(evaluator).iter().map(|scenes| scenes.count).sum()
}

/// The networks and skinning on every set.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let results =
        scenes(evaluator).iter().map(|scenes| evaluate(evaluator, scenes)).collect::<Result<Vec<_>, _>>()?;
    let of_sets = results.iter().enumerate().flat_map(|(i, set)| set.tables(i == 0));
    Ok(vec![Section {
        key: "methods",
        numbers: json!(results),
        title: "Networks and skinning (Table 2)",
        text: "LBS is the paper's baseline: smoothed nearest weights, body shape ignored. The networks start from LBS + shape transfer. Every \
               number is of one set, named in the title of its table."
            .into(),
        tables: [summary(&results)].into_iter().chain(of_sets).collect(),
        ..Section::default()
    }])
}

/// The networks against one other method: ratios of the [`COMPARED`].
#[derive(Serialize)]
struct Comparison {
    against: &'static str,
    #[serde(flatten)]
    ratios: BTreeMap<&'static str, Ratio>,
}

/// What is compared.
const COMPARED: [Metric<DrapeMetrics>; 4] = [
    ("strain", strain),
    ("collision", |m| m.score.weighted[Term::BodyCollision]),
    ("paper_collision", |m| m.paper_collision),
    ("total", |m| m.score.total),
];

fn strain(metrics: &DrapeMetrics) -> f64 {
    metrics.score.raw[Term::Strain]
}

/// The garments of one category.
#[derive(Serialize)]
struct CategoryResult {
    category: &'static str,
    /// Of every method.
    totals: Vec<Estimate>,
    /// Strain of the networks over that of LBS.
    strain: Ratio,
}

/// All methods on one set.
#[derive(Serialize)]
struct SetResult {
    title: String,
    set: SceneSet,
    scenes: usize,
    /// Weight and margin of the collision as the model's configuration has it.
    collision: String,
    garments: Vec<String>,
    methods: Vec<MethodResult>,
    comparisons: Vec<Comparison>,
    categories: Vec<CategoryResult>,
}

fn evaluate(evaluator: &Evaluator<'_>, scenes: &Scenes) -> Result<SetResult, DrapeError> {
    let model = evaluator.model;
    let samples = scenes.samples(evaluator);
    let measured =
        evaluator.measure(model, &samples, |scene| drape_by(evaluator.networks, &METHODS, scene))?;
    let of = |method: usize, scenes: &[usize]| -> Vec<&DrapeMetrics> {
        scenes.iter().map(|&i| &measured[i][method]).collect()
    };
    let ratio = |against: usize, scenes: &[usize], value: fn(&DrapeMetrics) -> f64| {
        let [network, other] =
            [NETWORK, against].map(|m| of(m, scenes).into_iter().map(value).collect::<Vec<_>>());
        Ratio::of(&network, &other)
    };
    let all: Vec<usize> = (0..samples.len()).collect();
    let category = |i: usize| model.dataset.garments.info(samples[i].garments[0]).category;
    let categories = Category::ALL.into_iter().filter_map(|wanted| {
        let scenes: Vec<usize> = all.iter().copied().filter(|&i| category(i) == wanted).collect();
        let total = |method| Estimate::of(of(method, &scenes).into_iter().map(|m| m.score.total));
        (!scenes.is_empty()).then(|| CategoryResult {
            category: wanted.name(),
            totals: (0..METHODS.len()).map(total).collect(),
            strain: ratio(0, &scenes, strain),
        })
    });
    let comparison = |against: usize| Comparison {
        against: METHODS[against].name(),
        ratios: COMPARED.into_iter().map(|(name, value)| (name, ratio(against, &all, value))).collect(),
    };
    let methods = METHODS.iter().enumerate();
    Ok(SetResult {
        title: scenes.set.title(&model.dataset),
        set: scenes.set,
        scenes: samples.len(),
        collision: model.collision_form(Term::BodyCollision),
        garments: model.names(&scenes.pool),
        methods: methods.map(|(m, method)| MethodResult::new(method.name(), &of(m, &all))).collect(),
        comparisons: (0..NETWORK).map(comparison).collect(),
        categories: categories.collect(),
    })
}

/// The paper's Table 2, on data that cannot be had: strain, bending, gravity, collision.
const PAPER: [[&str; 7]; 3] = [
    ["paper: SNUG, one model per garment", "–", "0.737", "0.115", "-0.46", "–", "0.165"],
    ["paper: ClothCombo", "–", "0.955", "0.105", "-0.478", "–", "0.62"],
    ["paper: LBS", "–", "2.177", "0.072", "-0.463", "–", "222.521"],
];

/// One row per set: what is quoted.
fn summary(sets: &[SetResult]) -> Table {
    let own = sets.first().map_or("", |set| set.collision.as_str());
    let network = |set: &SetResult, value: fn(&MethodResult) -> &Estimate| {
        let estimate = value(&set.methods[NETWORK]);
        format!("{} ({})", mean_with_interval(estimate), number(estimate.spread.median))
    };
    let ratio = |set: &SetResult, name: &str| ratio_with_interval(&set.comparisons[0].ratios[name]);
    Table::new(
        "The networks on every set, against LBS",
        sets,
        &[
            ("set", &|set| set.title.clone()),
            ("garments", &|set| set.garments.len().to_string()),
            ("scenes", &|set| set.scenes.to_string()),
            ("strain [J]", &|set| network(set, |method| method.raw(Term::Strain))),
            ("total [J]", &|set| network(set, |method| method.metric("total"))),
            ("strain over LBS", &|set| ratio(set, "strain")),
            ("of medians", &|set| number(set.comparisons[0].ratios["strain"].of_medians)),
            (&format!("collision over it ({own})"), &|set| ratio(set, "collision")),
            (&format!("collision over it ({PAPER_COLLISION})"), &|set| ratio(set, "paper_collision")),
            ("deeper than 5 mm [%]", &|set| {
                percent(set.methods[NETWORK].metric("deeper_than_5mm").spread.mean)
            }),
        ],
    )
    .with_note(
        "Means over the scenes [95 % interval of the mean] (median); ratios of means [95 % interval]. The intervals are over scenes, not over \
         garments: those of a set of few garments do not tell how much other garments would change.",
    )
}

impl SetResult {
    /// As tables; with the paper's numbers where they are of the same kind of set.
    fn tables(&self, with_paper: bool) -> Vec<Table> {
        let own = format!("collision ({})", self.collision);
        let paper = format!("collision ({PAPER_COLLISION})");
        let title = |what: &str| format!("{}: {what}", self.title);
        let energies = |title: String, cell: &dyn Fn(&Estimate) -> String| {
            Table::new(
                title,
                &self.methods,
                &[
                    ("method", &|m| m.method.to_owned()),
                    ("total", &|m| cell(m.metric("total"))),
                    ("strain", &|m| cell(m.raw(Term::Strain))),
                    ("bending", &|m| cell(m.raw(Term::Bending))),
                    ("gravity", &|m| cell(m.raw(Term::Gravity))),
                    (&own, &|m| cell(m.weighted(Term::BodyCollision))),
                    (&paper, &|m| cell(m.metric("paper_collision"))),
                ],
            )
        };
        let means = energies(
            title(&format!("energies [J], means over {} scenes [95 % interval]", self.scenes)),
            &mean_with_interval,
        );
        let spreads = energies(title("medians / 95th percentiles [J]"), &|e| {
            format!("{} / {}", number(e.spread.median), number(e.spread.p95))
        });
        let contact = Table::new(
            title("contact"),
            &self.methods,
            &[
                ("method", &|m| m.method.to_owned()),
                ("vertices inside [%]", &|m| percent_and_median(m.metric("inside"))),
                ("deeper than 5 mm [%]", &|m| percent_and_median(m.metric("deeper_than_5mm"))),
                ("pairs with the body", &|m| mean_and_median(m.metric("body_pairs"))),
                ("their contour [mm]", &|m| mean_and_median(m.metric("contour_mm"))),
                ("self-intersecting pairs", &|m| mean_and_median(m.metric("self_pairs"))),
            ],
        );
        let ratios = Table::new(
            title("the networks over skinning"),
            &self.comparisons,
            &[
                ("against", &|c| c.against.to_owned()),
                ("strain", &|c| ratio_with_interval(&c.ratios["strain"])),
                ("strain, medians", &|c| number(c.ratios["strain"].of_medians)),
                (&own, &|c| ratio_with_interval(&c.ratios["collision"])),
                (&paper, &|c| ratio_with_interval(&c.ratios["paper_collision"])),
                ("total", &|c| ratio_with_interval(&c.ratios["total"])),
                ("total, medians", &|c| number(c.ratios["total"].of_medians)),
            ],
        );
        let categories = Table::new(
            title("total [J] by category, mean (median)"),
            &self.categories,
            &[
                ("category", &|c| c.category.to_owned()),
                ("scenes", &|c| c.totals[0].scenes.to_string()),
                (METHODS[0].name(), &|c| mean_and_median(&c.totals[0])),
                (METHODS[1].name(), &|c| mean_and_median(&c.totals[1])),
                (METHODS[2].name(), &|c| mean_and_median(&c.totals[2])),
                ("strain over LBS", &|c| number(c.strain.of_means)),
            ],
        );
        vec![
            PAPER.into_iter().filter(|_| with_paper).fold(means, Table::with_row),
            spreads,
            contact.with_note("Means (medians) over the scenes; pairs of triangles that intersect exactly."),
            ratios.with_note(
                "Ratios of means [95 % interval] and of medians over the same scenes; the paper has 0.44 for strain and 1/359 for collision, in its \
                 own form, against LBS.",
            ),
            categories,
        ]
    }
}
