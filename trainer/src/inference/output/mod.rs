//! Everything a drape leaves on disk, as one folder that appears whole or not at all.
//!
//! ```text
//! OUT/body.obj  OUT/NAME.obj …       the body, and every garment with the vertices and polygons it was given with
//! OUT/frames/00012/…                 the same for every frame of a motion, if asked for
//! OUT/NAME.pc2, NAME.mdd …           the vertices of these OBJ files in every frame of a motion, as point caches
//! OUT/scene.glb                      body and garments as named, coloured meshes; a motion as morph targets
//! OUT/picture.png                    front, back and three-quarter
//! OUT/layers.png                     the same of each garment alone, where there is more than one
//! OUT/viewer.html                    one page without any other file: orbit, layers, frames, heat maps
//! OUT/report.json                    times, scores before and after the post-process, certificate
//! ```

mod picture;
mod show;
mod staged;
mod viewer;

pub use show::Show;
pub use staged::Staged;

use super::drape::Drape;
use super::report::DrapeReport;
use super::source::GivenGarment;
use crate::picture::{BODY_COLOUR, layer_colour, save_png};
use clothcombo_data::format::obj::{self, MovedObj};
use clothcombo_data::format::{FileError, PointFrames, SceneMesh, save_glb};
use miette::{IntoDiagnostic, Report};
use rayon::prelude::*;
use staged::cannot_write;
use std::path::Path;

/// Writes everything into `folder`, which is made if it is not there.
///
/// # Errors
/// When a file cannot be written, or a state cannot be measured.
pub fn write(folder: &Path, show: &Show) -> Result<DrapeReport, Report> {
    std::fs::create_dir_all(folder).map_err(|e| cannot_write(folder, &e))?;
    let (written, report) = rayon::join(
        || write_files(folder, show),
        || DrapeReport::new(show.draper, show.outfit, show.drapes, show.bodies, show.smoothing.cloned()),
    );
    let report = report?;
    written?;
    let json = serde_json::to_vec_pretty(&report).into_diagnostic()?;
    std::fs::write(folder.join("report.json"), json).map_err(|e| cannot_write(folder, &e))?;
    Ok(report)
}

/// Writes everything but the report into `folder`.
fn write_files(folder: &Path, show: &Show) -> Result<(), Report> {
    let files: [&(dyn Fn() -> Result<(), Report> + Sync); 5] = [
        &|| write_meshes(folder, show),
        &|| write_caches(folder, show).into_diagnostic(),
        &|| write_scene(&folder.join("scene.glb"), show).into_diagnostic(),
        &|| write_pictures(folder, show),
        &|| viewer::save(&folder.join("viewer.html"), show),
    ];
    files.par_iter().with_max_len(1).try_for_each(|write| write())
}

fn write_pictures(folder: &Path, show: &Show) -> Result<(), Report> {
    save_png(&picture::draw(show), &folder.join("picture.png")).into_diagnostic()?;
    match show.outfit.garments.len() {
        1 => Ok(()),
        _ => save_png(&picture::draw_layers(show), &folder.join("layers.png")).into_diagnostic(),
    }
}

/// The vertices of the OBJ files in every frame of a motion.
fn write_caches(folder: &Path, show: &Show) -> Result<(), FileError> {
    if show.bodies.moments.is_empty() {
        return Ok(());
    }
    let save = |name: &str, positions: &dyn Fn(&Drape) -> Vec<[f64; 3]>| {
        let mut frames = PointFrames::default();
        for (drape, moment) in show.drapes.iter().zip(&show.bodies.moments) {
            frames.push(moment.seconds, &positions(drape));
        }
        frames.save_pc2(&folder.join(format!("{name}.pc2")))?;
        frames.save_mdd(&folder.join(format!("{name}.mdd")))
    };
    save("body", &|drape| drape.body.clone())?;
    for (layer, garment) in show.outfit.garments.iter().enumerate() {
        save(&garment.name, &|drape| garment.source.in_given_order(&drape.garments[layer].positions))?;
    }
    Ok(())
}

fn write_meshes(folder: &Path, show: &Show) -> Result<(), Report> {
    for loss in write_frame(folder, show, &show.drapes[0])? {
        tracing::warn!("{loss}");
    }
    if show.all_frames {
        for (drape, moment) in show.drapes.iter().zip(&show.bodies.moments) {
            write_frame(&folder.join(format!("frames/{:05}", moment.frame)), show, drape)?;
        }
    }
    Ok(())
}

/// Returns what of the given files is lost, if anything: in every frame the same.
fn write_frame(folder: &Path, show: &Show, drape: &Drape) -> Result<Vec<String>, Report> {
    let mut lost = Vec::new();
    let body = show.draper.body();
    let comments = [format!("body {}", body.name)];
    obj::save(&folder.join("body.obj"), &drape.body, &body.faces, &comments).into_diagnostic()?;
    for (layer, (garment, draped)) in show.outfit.garments.iter().zip(&drape.garments).enumerate() {
        let source = &garment.source;
        let mut comments =
            vec![format!("{}, layer {layer} (0 = innermost), draped on {}", garment.name, body.name)];
        let from = &source.garment.source;
        // Garments under CC BY ask for their author's name wherever they go.
        for (what, value) in [("source", &from.source), ("author", &from.author), ("licence", &from.licence)]
        {
            if !value.is_empty() {
                comments.push(format!("{what}: {value}"));
            }
        }
        let positions = source.in_given_order(&draped.positions);
        let path = folder.join(format!("{}.obj", garment.name));
        let moved = as_given(source, &positions, &garment.name, &comments).unwrap_or_else(|reason| {
            lost.push(format!(
                "{} is written without texture coordinates, groups and materials: {reason}",
                garment.name
            ));
            None
        });
        match moved {
            Some(moved) => moved.save(folder, &garment.name).map_err(|e| cannot_write(&path, &e))?,
            None => {
                obj::save_polygons(&path, &positions, source.given.polygons(), &comments).into_diagnostic()?
            }
        }
    }
    Ok(lost)
}

/// The given OBJ file at other positions, with its texture coordinates, groups and materials; `None` for another format.
///
/// # Errors
/// Naming the file, when it cannot be read any more, or is no longer what was read.
fn as_given(
    source: &GivenGarment,
    positions: &[[f64; 3]],
    name: &str,
    comments: &[String],
) -> Result<Option<MovedObj>, String> {
    let Some(path) = source.obj_path() else { return Ok(None) };
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut moved = MovedObj::new(path, &bytes, positions, name).map_err(|found| {
        let read = positions.len();
        format!("{} cannot be repeated line by line, of {read} vertices {found} are found", path.display())
    })?;
    let lines = comments.iter().flat_map(|comment| comment.lines());
    let mut bytes: Vec<u8> = lines.flat_map(|line| format!("# {line}\n").into_bytes()).collect();
    bytes.extend_from_slice(
        b"# what follows is the file as it was given, with other vertices and without normals\n",
    );
    bytes.append(&mut moved.obj);
    Ok(Some(MovedObj { obj: bytes, ..moved }))
}

fn write_scene(path: &Path, show: &Show) -> Result<(), FileError> {
    let mut meshes = vec![SceneMesh {
        name: "body",
        colour: BODY_COLOUR,
        faces: &show.draper.body().faces,
        frames: show.drapes.iter().map(|d| d.body.as_slice()).collect(),
        texture: None,
    }];
    for (layer, garment) in show.outfit.garments.iter().enumerate() {
        meshes.push(SceneMesh {
            name: &garment.name,
            colour: layer_colour(layer),
            faces: garment.prepared.garment.rest.faces(),
            frames: show.drapes.iter().map(|d| d.garments[layer].positions.as_slice()).collect(),
            texture: garment.source.texture(),
        });
    }
    let times: Vec<f64> = show.bodies.moments.iter().map(|m| m.seconds).collect();
    save_glb(path, &meshes, &times)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::asset::Category;
    use clothcombo_data::generate::{GarmentGenerator, mannequin};

    #[test]
    fn what_cannot_be_repeated_of_a_given_file_is_told_with_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tee.obj");
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let garment = generator.generate(Category::TShirt, 0, 250).unwrap();
        let positions = garment.rest.positions().to_vec();
        obj::save(&path, &positions, garment.rest.faces(), &[]).unwrap();
        let mut source = GivenGarment::new(garment);
        let given =
            |source: &GivenGarment| as_given(source, &positions, "tee", &[]).map(|moved| moved.is_some());
        assert_eq!(given(&source), Ok(false), "of no file there is nothing to repeat");
        source.path = Some(path.clone());
        assert_eq!(given(&source), Ok(true));
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        let reason = given(&source).unwrap_err();
        assert!(reason.contains("tee.obj") && reason.contains("vertices 1 are found"), "{reason}");
        std::fs::remove_file(&path).unwrap();
        assert!(given(&source).unwrap_err().contains("tee.obj"));
        source.path = Some(path.with_extension("ply"));
        assert_eq!(given(&source), Ok(false));
    }
}
