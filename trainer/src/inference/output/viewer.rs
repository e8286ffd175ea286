//! The viewer: one HTML page that holds the scene and draws it with WebGL 2, without any other file or the network.
//!
//! The page is `viewer.html` beside this file; here the scene is packed into it. Positions are 16-bit numbers within the box of
//! their mesh (0.03 mm for a person of two metres), strain and distance to the body 8-bit numbers:
//!
//! ```text
//! per mesh   u32 faces [F, 3]   u16 positions [frames, V, 3]   u8 heat [frames, V, 2] (strain, distance)
//! ```

use super::show::Show;
use super::staged::cannot_write;
use crate::inference::drape::Drape;
use crate::picture::{BODY_COLOUR, layer_colour};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use clothcombo_data::format::atomic;
use clothcombo_physics::contact::resolve::{Certificate, IntersectedSurface, certify};
use clothcombo_physics::mesh::vertex_stretch;
use clothcombo_physics::query::Distance;
use miette::Report;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

const PAGE: &str = include_str!("viewer.html");
/// Places in the page that are replaced.
const SCENE_PLACE: &str = "/*SCENE*/";
const DATA_PLACE: &str = "/*DATA*/";

/// Stretch at the end of the strain scale.
const STRAIN_SCALE: f64 = 0.25;
/// Ends of the scale of distances to the body (mm).
const GAP_SCALE: [f64; 2] = [-10.0, 40.0];
/// Most bytes of a page's scene; of a longer motion every so-manieth frame is shown.
const MOST_SCENE_BYTES: usize = 96 << 20;

pub(super) fn save(path: &Path, show: &Show) -> Result<(), Report> {
    let page = page(show)?;
    atomic::write(path, page.as_bytes()).map_err(|e| cannot_write(path, &e))
}

fn page(show: &Show) -> Result<String, Report> {
    let stages = stages(show)?;
    let mut binary = Vec::new();
    let body = &show.draper.body().faces;
    let still = vec![0; 2 * show.drapes[0].body.len()];
    let of_body: Vec<_> = stages.iter().map(|stage| (stage.body, &still[..])).collect();
    let about = json!({ "name": "body", "colour": BODY_COLOUR, "layer": -1 });
    let mut meshes = vec![pack(&mut binary, about, body, &of_body)];
    for (layer, garment) in show.outfit.garments.iter().enumerate() {
        let about = json!({ "name": garment.name, "colour": layer_colour(layer), "layer": layer });
        let frames: Vec<_> =
            stages.iter().map(|stage| (stage.garments[layer], &stage.heat[layer][..])).collect();
        meshes.push(pack(&mut binary, about, garment.prepared.garment.rest.faces(), &frames));
    }
    let moves = !show.bodies.moments.is_empty();
    let scene = json!({
        "title": show.title,
        "moves": moves,
        "first": if moves { 0 } else { stages.len() - 1 },
        "heading": show.drapes[0].heading,
        "strain": STRAIN_SCALE,
        "gap": GAP_SCALE,
        "zero": f64::from(gap_byte(0.0)) / 255.0,
        "frames": stages.iter().map(|s| json!({ "name": s.name, "time": s.time })).collect::<Vec<_>>(),
        "meshes": meshes,
    });
    // Inside a script element only `<` could end it.
    let scene = scene.to_string().replace('<', "\\u003c");
    let (head, rest) = PAGE.split_once(SCENE_PLACE).unwrap_or((PAGE, ""));
    let (middle, tail) = rest.split_once(DATA_PLACE).unwrap_or((rest, ""));
    let mut page = String::with_capacity(PAGE.len() + scene.len() + binary.len() * 4 / 3 + 4);
    page.extend([head, &scene, middle]);
    STANDARD.encode_string(&binary, &mut page);
    page.push_str(tail);
    Ok(page)
}

/// One state of body and garments.
struct Stage<'a> {
    name: String,
    time: f64,
    body: &'a [[f64; 3]],
    garments: Vec<&'a [[f64; 3]]>,
    /// Per garment strain and distance of every vertex.
    heat: Vec<Vec<u8>>,
}

/// The frames of a motion, or the stages of a single drape.
fn stages<'a>(show: &Show<'a>) -> Result<Vec<Stage<'a>>, Report> {
    if let ([drape], []) = (show.drapes, &show.bodies.moments[..]) {
        let mut states: Vec<(&str, Vec<&[[f64; 3]]>, Option<&Certificate>)> = vec![
            ("linear blend skinning", drape.garments.iter().map(|g| g.skinned.as_slice()).collect(), None),
            ("networks", drape.garments.iter().map(|g| g.network.as_slice()).collect(), None),
        ];
        let resolved: Option<_> = drape.garments.iter().map(|g| g.resolved.as_deref()).collect();
        states.extend(resolved.map(|resolved| ("post-process", resolved, None)));
        let result = drape.garments.iter().map(|g| g.positions.as_slice()).collect();
        states.push(("result", result, Some(&drape.certificate)));
        let stages = states.into_par_iter().map(|(name, garments, certificate)| {
            stage(show, drape, name.to_owned(), 0.0, garments, certificate)
        });
        return stages.collect();
    }
    let frames = show.drapes.len();
    let vertices: usize = show.draper.body().vertex_count()
        + show.outfit.garments.iter().map(|p| p.prepared.vertex_count()).sum::<usize>();
    let every = (8 * vertices * frames).div_ceil(MOST_SCENE_BYTES).max(1);
    if every > 1 {
        tracing::info!("viewer.html shows every {every}th of {frames} frames; scene.glb holds all");
    }
    (0..frames)
        .into_par_iter()
        .step_by(every)
        .map(|frame| {
            let (drape, moment) = (&show.drapes[frame], show.bodies.moments[frame]);
            let name = format!("frame {} · {:.2} s", moment.frame, moment.seconds);
            let garments = drape.garments.iter().map(|g| g.positions.as_slice()).collect();
            let time = moment.seconds - show.bodies.moments[0].seconds;
            stage(show, drape, name, time, garments, Some(&drape.certificate))
        })
        .collect()
}

fn stage<'a>(
    show: &Show<'a>,
    drape: &'a Drape,
    name: String,
    time: f64,
    garments: Vec<&'a [[f64; 3]]>,
    certificate: Option<&Certificate>,
) -> Result<Stage<'a>, Report> {
    let surface = drape.surface(show.draper);
    let counted;
    let certificate = match certificate {
        Some(certificate) => certificate,
        None => {
            counted = certify(&surface, &show.outfit.layers(&garments)).map_err(|e| show.outfit.named(e))?;
            &counted
        }
    };
    let intersecting = intersecting_vertices(show, certificate);
    let heat = garments.iter().enumerate().map(|(layer, positions)| {
        let strain = vertex_stretch(&show.outfit.garments[layer].prepared.garment.rest, positions);
        let gaps: Vec<f64> =
            positions.par_iter().with_min_len(256).map(|p| surface.gap(*p, Distance::Union).gap).collect();
        let bytes =
            strain.iter().zip(gaps).zip(&intersecting[layer]).flat_map(|((strain, gap), intersects)| {
                let strain = (255.0 * (strain / STRAIN_SCALE).min(1.0)).round() as u8;
                [strain, if *intersects { 0 } else { gap_byte(1e3 * gap) }]
            });
        bytes.collect()
    });
    Ok(Stage { name, time, body: &drape.body, heat: heat.collect(), garments })
}

/// Per garment whether a vertex belongs to a triangle that intersects something.
fn intersecting_vertices(show: &Show, certificate: &Certificate) -> Vec<Vec<bool>> {
    let garments = &show.outfit.garments;
    let mut intersecting: Vec<Vec<bool>> =
        garments.iter().map(|p| vec![false; p.prepared.vertex_count()]).collect();
    let mut mark = |garment: usize, triangle: usize| {
        if let Some(face) = garments[garment].prepared.garment.rest.faces().get(triangle) {
            face.iter().for_each(|v| intersecting[garment][*v as usize] = true);
        }
    };
    for pair in &certificate.remaining {
        mark(pair.garment, pair.triangle);
        match pair.intersects {
            IntersectedSurface::Body => {}
            IntersectedSurface::Layer(other) => mark(other, pair.other_triangle),
            IntersectedSurface::Itself => mark(pair.garment, pair.other_triangle),
        }
    }
    intersecting
}

/// 1–255 within [`GAP_SCALE`]; 0 is for what intersects.
fn gap_byte(millimetres: f64) -> u8 {
    let share = ((millimetres - GAP_SCALE[0]) / (GAP_SCALE[1] - GAP_SCALE[0])).clamp(0.0, 1.0);
    1 + (254.0 * share).round() as u8
}

/// Appends a mesh with the positions and heat of its `frames` to `binary`, and completes what is said `about` it.
fn pack(
    binary: &mut Vec<u8>,
    mut about: Value,
    faces: &[[u32; 3]],
    frames: &[(&[[f64; 3]], &[u8])],
) -> Value {
    let positions = || frames.iter().flat_map(|(positions, _)| *positions);
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for p in positions() {
        for a in 0..3 {
            low[a] = low[a].min(p[a]);
            high[a] = high[a].max(p[a]);
        }
    }
    let step: [f64; 3] = std::array::from_fn(|a| ((high[a] - low[a]) / 65535.0).max(1e-9));
    let start = |binary: &mut Vec<u8>| {
        binary.resize(binary.len().next_multiple_of(4), 0);
        binary.len()
    };
    about["faces"] = json!(start(binary));
    binary.extend(faces.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    about["positions"] = json!(start(binary));
    for p in positions() {
        for a in 0..3 {
            let packed = ((p[a] - low[a]) / step[a]).round().clamp(0.0, 65535.0) as u16;
            binary.extend_from_slice(&packed.to_le_bytes());
        }
    }
    about["heat"] = json!(start(binary));
    frames.iter().for_each(|(_, heat)| binary.extend_from_slice(heat));
    about["vertices"] = json!(frames.first().map_or(0, |(positions, _)| positions.len()));
    about["triangles"] = json!(faces.len());
    about["low"] = json!(low);
    about["step"] = json!(step);
    about
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_positions_are_within_half_a_step_and_aligned() {
        let frames = [[[0.1, -0.5, 2.0], [0.7, 0.5, 2.0]], [[0.3, 0.0, 2.0], [-0.2, 0.25, 2.0]]];
        let mut binary = vec![7u8; 5];
        let given = frames.each_ref().map(|positions| (positions.as_slice(), [9; 4].as_slice()));
        let about = pack(&mut binary, json!({ "name": "tee" }), &[[0, 1, 1]], &given);
        let at = |key: &str| about[key].as_u64().unwrap() as usize;
        assert_eq!((at("vertices"), at("triangles"), at("faces") % 4, at("positions") % 4), (2, 1, 0, 0));
        for (i, value) in frames.as_flattened().as_flattened().iter().enumerate() {
            let bytes = &binary[at("positions") + 2 * i..][..2];
            let number = |key: &str| about[key][i % 3].as_f64().unwrap();
            let found = number("low") + number("step") * f64::from(u16::from_le_bytes([bytes[0], bytes[1]]));
            assert!((found - value).abs() <= 0.51 * number("step"), "{found} for {value}");
        }
        assert_eq!(&binary[at("heat")..], [9; 8]);
    }

    #[test]
    fn the_page_has_both_places_once_and_asks_nobody_for_anything() {
        assert_eq!((PAGE.matches(SCENE_PLACE).count(), PAGE.matches(DATA_PLACE).count()), (1, 1));
        for outside in ["http:", "https:", "//cdn", "src=", "@import", "fetch(", "XMLHttpRequest"] {
            assert!(!PAGE.contains(outside), "{outside}");
        }
    }

    #[test]
    fn gaps_keep_the_lowest_number_for_intersections() {
        assert_eq!(
            [gap_byte(-50.0), gap_byte(GAP_SCALE[0]), gap_byte(GAP_SCALE[1]), gap_byte(900.0)],
            [1, 1, 255, 255]
        );
    }
}
