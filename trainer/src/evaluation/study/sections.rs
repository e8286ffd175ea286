//! The report of an evaluation: its parts, in the order of the paper.

use super::{EmbeddingStudy, Section, Study, Table, Variant, extremes, layers, methods, numerics, variants};
use crate::picture::{draw_lines, png_bytes};
use miette::{IntoDiagnostic, Report};

impl Study {
    /// The parts of the report, in the order of the paper.
    ///
    /// # Errors
    /// When a chart cannot be drawn.
    pub fn sections(&self) -> Result<Vec<Section>, Report> {
        let section = |title: &str, text: &str, tables: Vec<Table>| Section {
            title: title.into(),
            text: text.into(),
            tables,
            pictures: Vec::new(),
        };
        let mut tables = vec![methods::summary(&self.methods)];
        tables.extend(self.methods.iter().enumerate().flat_map(|(i, methods)| methods.tables(i == 0)));
        let mut sections = vec![
            section(
                "Sets",
                "A run trains on the training set and scores the validation set; the test set is read by no run, only here. Bodies have random shapes \
                 within the range of the configuration.",
                vec![self.sets.table()],
            ),
            section(
                "Networks and skinning (Table 2)",
                "LBS of rest is the paper's baseline: smoothed nearest weights, body shape ignored. LBS adds shape transfer, where the networks \
                 start. Every number is of one set, named in the title of its table.",
                tables,
            ),
            section(
                "Embeddings (Table 1)",
                "The networks without corrections are what compares with the paper: corrections see where the cloth lies and are \
                 accepted as far as they lower the energy, which repairs what a wrong embedding does.",
                self.embeddings.iter().map(EmbeddingStudy::table).collect(),
            ),
            section(
                "Layers (Table 3)",
                "Training, validation and test garments in random order, in held-out windows, on bodies of random shape.",
                layers::tables(&self.layers),
            ),
        ];
        if !self.ablations.is_empty() {
            let note = "Means (medians) over outfits of 1 to 4 garments of all sets in held-out windows, the same for every model; before the \
                        post-process. Wrong side by the nearest vertex. Self-collision: (1/N) Σ −log d² [d in m] over pairs of vertices of one garment \
                        that no edge joins, are closer than 0.1 m and both belong to triangles that intersect another triangle of the garment, summed \
                        over the garments; the paper does not print its normalisation, so that its values compare among themselves only.";
            let table = variants::table("Ablations", note, &self.ablations, true);
            sections.push(section("Ablations (Table 4)", "", vec![table]));
        }
        if !self.specific.is_empty() {
            let all: Vec<Variant> = self.specific.iter().flatten().cloned().collect();
            let note = "Means (medians) over the same bodies in held-out windows.";
            let table =
                variants::table("One model for all garments beside one per garment", note, &all, false);
            sections.push(section("Garment-specific models (Table 2)", &self.specific_text(), vec![table]));
        }
        sections.push(section("Time per phase (Table 5)", "", vec![self.times.table()]));
        let mut pareto = section("Speed against error", "", vec![self.pareto.table()]);
        let chart = draw_lines("Speed against error", &self.pareto.panels()).into_diagnostic()?;
        pareto.pictures.push((
            "pareto.png".into(),
            "Medians; down and to the left is better.".into(),
            png_bytes(&chart).into_diagnostic()?,
        ));
        sections.push(pareto);
        sections.push(section("Numerical choices", "", vec![numerics::table(&self.numerics)]));
        sections.push(section("Stability", "", vec![extremes::table(&self.extremes)]));
        if !self.pictures.is_empty() {
            let mut gallery = section(
                "Gallery",
                "After the post-process. Names in the legend stand for garments, colours without names for layers from inner to outer.",
                Vec::new(),
            );
            for picture in &self.pictures {
                let file = format!("{}.png", picture.name);
                gallery.pictures.push((
                    file,
                    picture.caption.clone(),
                    png_bytes(&picture.image).into_diagnostic()?,
                ));
            }
            sections.push(gallery);
        }
        Ok(sections)
    }

    /// What the comparison with garment-specific models shows and what not.
    fn specific_text(&self) -> String {
        let models = self.specific.iter().map(|[general, specific]| {
            format!(
                "{} (width {}, {} steps; the model for all garments has width {})",
                specific.name, specific.width, specific.steps, general.width
            )
        });
        format!(
            "The paper trains SNUG for each of six garments, and this is what its model for all garments is a little worse than. Here: {}. \
             They are models of this program (the same networks and losses) that were trained on one garment each, not SNUG. The table shows \
             whether the model for all garments is behind a model of that size and training on that garment. It does not show what a garment-specific \
             model of the same size and training would reach, nor how the comparison varies over garments.",
            models.collect::<Vec<_>>().join("; ")
        )
    }
}
