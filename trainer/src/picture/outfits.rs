//! Dressed bodies on a sheet: front, back and three-quarter, a row each.

use image::RgbImage;
use rayon::prelude::*;

use super::View;
use super::figure::Figure;
use super::palette::{BODY_COLOUR, layer_colour};
use super::render::render;
use super::sheet::{LegendEntry, PictureSheet, SheetRow};

/// Width and height of one view (pixels).
const VIEW_SIZE: [u32; 2] = [340, 540];
/// Garments named on one line of the legend, from inner to outer.
const NAMES_PER_LINE: usize = 3;
const OUTFIT_VIEWS: [View; 3] = [View::Front, View::Back, View::ThreeQuarter];

/// Positions (m) and faces of a mesh.
pub type MeshSlices<'a> = (&'a [[f64; 3]], &'a [[u32; 3]]);

/// A dressed body.
#[derive(Clone, Debug)]
pub struct DressedRow<'a> {
    /// What tells it from the other rows; none if empty.
    pub label: String,
    /// The body.
    pub body: MeshSlices<'a>,
    /// Where it faces: the angle about the vertical from +z towards +x (rad).
    pub heading: f64,
    /// Its garments, innermost first.
    pub garments: Vec<MeshSlices<'a>>,
    /// Number of the innermost one in its outfit: 0, unless it is shown without those under it.
    pub innermost: usize,
}

impl<'a> DressedRow<'a> {
    /// The body with each garment alone, by the `names` of the garments: an outer layer hides what is wrong with an inner one.
    #[must_use]
    pub fn layers(&self, names: &[&str]) -> Vec<DressedRow<'a>> {
        let alone = |(layer, (&garment, name)): (usize, (&MeshSlices<'a>, &&str))| DressedRow {
            label: (*name).to_owned(),
            garments: vec![garment],
            innermost: self.innermost + layer,
            ..self.clone()
        };
        self.garments.iter().zip(names).enumerate().map(alone).collect()
    }
}

/// Draws `rows` from top to bottom under a `title`; `names` are those of the garments, which every row has.
pub fn draw_dressed(title: &str, names: &[&str], rows: &[DressedRow<'_>]) -> RgbImage {
    let views = rows.par_iter().flat_map(|row| OUTFIT_VIEWS.into_par_iter().map(|view| draw_view(row, view)));
    let views: Vec<RgbImage> = views.collect();
    let entries: Vec<LegendEntry> = names
        .iter()
        .enumerate()
        .map(|(layer, name)| LegendEntry { colour: layer_colour(layer), name: (*name).to_owned() })
        .collect();
    // Lines of the legend; the last one is that of a first row without a label.
    let mut lines: Vec<SheetRow> = entries
        .chunks(NAMES_PER_LINE)
        .map(|names| SheetRow { legend: names.to_vec(), ..SheetRow::default() })
        .collect();
    for (number, (row, cells)) in rows.iter().zip(views.chunks(OUTFIT_VIEWS.len())).enumerate() {
        match lines.last_mut() {
            Some(last) if number == 0 && row.label.is_empty() => last.cells = cells.to_vec(),
            _ => lines.push(SheetRow {
                label: row.label.clone(),
                cells: cells.to_vec(),
                ..SheetRow::default()
            }),
        }
    }
    let columns = OUTFIT_VIEWS.iter().map(|view| view.name().to_owned()).collect();
    PictureSheet { title: title.to_owned(), columns, rows: lines }.compose()
}

fn draw_view(row: &DressedRow<'_>, view: View) -> RgbImage {
    // Front is where the body faces.
    let (azimuth, elevation) = view.angles();
    let view = View::Orbit { azimuth: azimuth + row.heading, elevation };
    let body = Figure { positions: row.body.0, faces: row.body.1, colour: BODY_COLOUR };
    let garments = row.garments.iter().enumerate().map(|(layer, &(positions, faces))| Figure {
        positions,
        faces,
        colour: layer_colour(row.innermost + layer),
    });
    let figures: Vec<Figure> = std::iter::once(body).chain(garments).collect();
    render(&figures, view, VIEW_SIZE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes;

    #[test]
    fn every_row_shows_its_own_cloth_under_the_names_of_all() {
        let (body, cloth) = (shapes::icosphere(0.2, 1), shapes::icosphere(0.3, 1));
        let slim: Vec<[f64; 3]> = cloth.positions().iter().map(|p| [0.8 * p[0], p[1], p[2]]).collect();
        let row = |label: &str, positions| DressedRow {
            label: label.to_owned(),
            body: (body.positions(), body.faces()),
            heading: 0.0,
            garments: vec![(positions, cloth.faces())],
            innermost: 0,
        };
        let sheet = |rows: &[DressedRow<'_>]| draw_dressed("title", &["cloth"], rows);
        let (wide, slim) = (row("one", cloth.positions()), row("two", &slim));
        let [both, same, first] = [
            vec![wide.clone(), slim],
            vec![wide.clone(), DressedRow { label: "two".into(), ..wide.clone() }],
            vec![wide],
        ]
        .map(|rows| sheet(&rows));
        assert_eq!(both.dimensions(), same.dimensions());
        assert!(first.height() > VIEW_SIZE[1] && both.height() > first.height() + VIEW_SIZE[1]);
        let differ: Vec<u32> = both
            .enumerate_pixels()
            .zip(same.pixels())
            .filter(|((.., a), b)| a != b)
            .map(|((_, y, _), _)| y)
            .collect();
        assert!(differ.len() > 500 && differ.iter().all(|y| *y > first.height() - 20), "{}", differ.len());
        // A lone drape has no label and stands beside the names.
        let alone = sheet(&[row("", cloth.positions())]);
        assert!(alone.height() < first.height());
    }

    #[test]
    fn each_garment_alone_keeps_its_colour_and_shows_what_was_hidden() {
        let mesh = shapes::icosphere(0.2, 2);
        let scaled = |by: f64| mesh.positions().iter().map(|p| p.map(|x| by * x)).collect::<Vec<[f64; 3]>>();
        let (inner, outer) = (scaled(1.1), scaled(1.2));
        let row = DressedRow {
            label: "both".into(),
            body: (mesh.positions(), mesh.faces()),
            heading: 0.0,
            garments: vec![(&inner, mesh.faces()), (&outer, mesh.faces())],
            innermost: 0,
        };
        let layers = row.layers(&["tee", "coat"]);
        assert_eq!(layers.iter().map(|row| row.label.as_str()).collect::<Vec<_>>(), ["tee", "coat"]);
        let middle = |row: &DressedRow<'_>| {
            draw_view(row, View::Front).get_pixel(VIEW_SIZE[0] / 2, VIEW_SIZE[1] / 2).0
        };
        let [both, tee, coat] = [&row, &layers[0], &layers[1]].map(middle);
        let differ = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > 20);
        assert!(!differ(both, coat) && differ(both, tee), "{both:?} {tee:?} {coat:?}");
    }
}
