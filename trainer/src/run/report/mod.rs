//! `RUN/report.html`: everything worth knowing about a run on one page that needs nothing but itself.

mod charts;
pub mod html;
pub mod table;

pub use charts::StageBaseline;
pub(super) use charts::charts;

use crate::dataset::LicenceLine;
use crate::picture::chart::axis::number_text;
use crate::picture::chart::{RunSteps, legend_html, median_of_last};
use crate::run::memory::MemoryEstimate;
use crate::run::observer::History;
use crate::system::memory::gibibytes;
use html::{escape, figure, image, utc};
use serde_json::Value;
use std::path::{Path, PathBuf};
use table::{Column, Table, plain};

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunState {
    /// It trains.
    Running,
    /// It was asked to stop.
    Interrupted,
    /// Too many of its steps were not finite.
    GaveUp,
    /// All steps are done.
    Finished,
}

impl RunState {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Interrupted => "interrupted",
            Self::GaveUp => "gave up",
            Self::Finished => "finished",
        }
    }
}

/// What is known of a run from its start on.
pub struct RunFacts {
    /// Name of the run.
    pub name: String,
    /// The steps of the run and its stages.
    pub steps: RunSteps,
    /// What every stage is compared with.
    pub baselines: Vec<StageBaseline>,
    /// The configuration, as TOML.
    pub config: String,
    /// Name of the device it runs on.
    pub device: String,
    /// Terms of use of the data.
    pub licences: Vec<LicenceLine>,
    /// Memory expected at the start.
    pub memory: Option<MemoryEstimate>,
    /// Number of files of the data that `check.json` has warnings of.
    pub warned_files: usize,
}

/// What the page is made of.
pub struct RunPage<'a> {
    /// What is known from the start on.
    pub facts: &'a RunFacts,
    /// Where it stands.
    pub state: RunState,
    /// When this page was made (s since 1970).
    pub made: u64,
    /// Steps per second of this session.
    pub speed: Option<f64>,
    /// The logs.
    pub history: &'a History,
    /// Most memory used so far (bytes).
    pub peak: Option<u64>,
}

/// Sample sheets shown, newest first.
const SHOWN_SAMPLES: usize = 2;

/// What is shown of every method of a validation.
const VALIDATION: [Column<'_>; 9] = [
    ("method", "/method", plain),
    ("total", "/total/mean", four_digits),
    ("median", "/total/median", four_digits),
    ("strain", "/raw/strain/mean", four_digits),
    ("bending", "/raw/bending/mean", four_digits),
    ("gravity", "/raw/gravity/mean", four_digits),
    ("inside %", "/inside", hundredths_of_percent),
    ("> 5 mm %", "/deeper_than_5mm", hundredths_of_percent),
    ("layer-order violations %", "/order_violations_nearest_vertex", hundredths_of_percent),
];

fn four_digits(value: &Value) -> String {
    value.as_f64().map_or("–".to_owned(), |value| number_text(value, 4))
}

fn hundredths_of_percent(share: &Value) -> String {
    share.as_f64().map_or("–".to_owned(), |share| format!("{:.2}", 100.0 * share))
}

impl RunPage<'_> {
    /// The page.
    pub fn html(&self) -> String {
        // A page that is still being written looks for its next version.
        let refresh = match self.state {
            RunState::Running => "<meta http-equiv=\"refresh\" content=\"30\">",
            _ => "",
        };
        let config = format!(
            "<section id=\"config\"><h2>Configuration</h2><details><summary>every value used</summary><pre>{}</pre></details></section>\n",
            escape(&self.facts.config)
        );
        let curves = self.curves();
        let parts = [self.header(), curves, self.validation(), self.samples(), self.licence_list(), config];
        html::page(&format!("{} – {}", self.facts.name, self.state.name()), refresh, &parts.concat())
    }

    fn header(&self) -> String {
        let facts = self.facts;
        let step = self.history.last.as_ref().map_or(0, |(step, _)| *step);
        let stage = self.history.last.as_ref().map_or("", |(_, stage)| stage.as_str());
        let percent = 100.0 * step as f64 / facts.steps.total.max(1) as f64;
        let mut tiles = vec![("step", format!("{step} of {}", facts.steps.total)), ("stage", escape(stage))];
        if let Some(speed) = self.speed.filter(|s| *s > 0.0) {
            tiles.push(("speed", format!("{} steps/s", number_text(speed, 3))));
            if self.state == RunState::Running {
                let left = (facts.steps.total.saturating_sub(step)) as f64 / speed;
                tiles.push(("time left", duration(left)));
            }
        }
        if let Some(loss) = median_of_last(self.history.points("loss"), 100) {
            tiles.push(("loss, median of 100", number_text(loss, 4)));
        }
        if let Some((step, score)) = self.history.best {
            tiles.push(("best validation", format!("{} at step {step}", number_text(score, 4))));
        }
        tiles.push(("device", escape(&facts.device)));
        tiles.push(("skipped steps", self.history.skipped.len().to_string()));
        tiles.push(("gradient spikes", self.history.spikes.len().to_string()));
        if facts.warned_files > 0 {
            tiles.push(("data", format!("warnings about {} files", facts.warned_files)));
        }
        if let Some(peak) = self.peak {
            let estimated =
                facts.memory.map(|m| format!(" (estimated {})", gibibytes(m.peak()))).unwrap_or_default();
            tiles.push(("peak memory", format!("{}{estimated}", gibibytes(peak))));
        }
        let tiles: String = tiles
            .iter()
            .map(|(name, value)| format!("<div class=\"tile\"><small>{name}</small><b>{value}</b></div>"))
            .collect();
        format!(
            "<header><h1>{} <span class=\"state {}\">{}</span></h1><p>as of {}</p>\
                <div class=\"bar\"><i style=\"width:{percent:.1}%\"></i></div><div class=\"tiles\">{tiles}</div></header>\n",
            escape(&facts.name),
            self.state.name().replace(' ', "-"),
            self.state.name(),
            utc(self.made)
        )
    }

    fn curves(&self) -> String {
        let keys = legend_html(&RunSteps::legend());
        let figures: String = charts(self.history, &self.facts.steps, &self.facts.baselines)
            .iter()
            .map(|(name, chart)| format!("<figure id=\"chart-{name}\">{}</figure>\n", chart.svg()))
            .collect();
        format!(
            "<section id=\"curves\"><h2>Curves</h2><p class=\"legend\">{keys}</p><div class=\"grid-of\">\n{figures}</div></section>\n"
        )
    }

    fn validation(&self) -> String {
        let Some((step, report)) = self.history.validations.last() else { return String::new() };
        let table = |group: &Value| {
            let title = format!("{}, {} scenes", plain(&group["group"]), group["scenes"]);
            let methods = group["methods"].as_array().map_or(&[][..], Vec::as_slice);
            Table::new(title, methods, &VALIDATION).html()
        };
        let tables: String = report["groups"].as_array().into_iter().flatten().map(table).collect();
        format!("<section id=\"validation\"><h2>Validation after step {step}</h2>\n{tables}</section>\n")
    }

    fn samples(&self) -> String {
        let sample = |path: &PathBuf| {
            // A picture that was deleted is no reason to have no report.
            let png = std::fs::read(path).ok()?;
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            Some(figure(&name, &image(&name, &png)))
        };
        let shown: String =
            self.history.samples.iter().rev().take(SHOWN_SAMPLES).filter_map(sample).collect();
        let shown = if shown.is_empty() { "<p>none drawn yet</p>" } else { &shown };
        format!("<section id=\"samples\"><h2>Samples</h2>\n{shown}</section>\n")
    }

    fn licence_list(&self) -> String {
        let row = |line: &LicenceLine| {
            let known = |text: &str| if text.is_empty() { "unknown" } else { text }.to_owned();
            let and_others = if line.count > 1 { ", …" } else { "" };
            let [licence, author, source] =
                [&line.from.licence, &line.from.author, &line.from.source].map(|text| known(text));
            vec![line.kind.to_string(), line.count.to_string(), licence, author, source + and_others]
        };
        let table = Table {
            head: ["data", "number", "licence", "author", "source"].map(str::to_owned).to_vec(),
            rows: self.facts.licences.iter().map(row).collect(),
            ..Table::default()
        };
        format!("<section id=\"licences\"><h2>Data and licences</h2>{}</section>\n", table.html())
    }
}

/// Seconds as `3 h 20 min`, `20 min` or `45 s`.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if !s.is_finite() => "unknown".into(),
        s if s >= 172_800.0 => format!("{:.1} days", s / 86_400.0),
        s if s >= 3600.0 => format!("{} h {} min", (s / 3600.0) as u64, (s / 60.0) as u64 % 60),
        s if s >= 90.0 => format!("{:.0} min", s / 60.0),
        s => format!("{s:.0} s"),
    }
}

/// Name of a run: its folder.
pub fn run_name(root: &Path) -> String {
    let full = root.canonicalize().unwrap_or_else(|_| root.to_owned());
    full.file_name().map_or_else(|| "run".into(), |n| n.to_string_lossy().into_owned())
}
