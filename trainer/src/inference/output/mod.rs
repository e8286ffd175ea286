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
mod staged;
mod viewer;

pub use staged::Staged;

use super::{Bodies, Drape, Draper, DraperError, GivenGarment, Outfit, Report, Smoothing};
use crate::picture::{BODY_COLOUR, PictureError, layer_colour};
use clothcombo_data::format::obj::{self, MovedObj};
use clothcombo_data::format::{FileError, PointFrames, SceneMesh, save_glb};
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use std::time::Instant;
use thiserror::Error;

/// Why a drape cannot be written.
#[derive(Debug, Error, Diagnostic)]
pub enum OutputError {
    /// Something else is there.
    #[error("{} is there and is not empty", path.display())]
    #[diagnostic(help("choose another folder, or pass --replace if it holds earlier results"))]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// A file is where a folder is wanted.
    #[error("{} is a file, not a folder", file.display())]
    #[diagnostic(help("-o names the folder to be made: choose another name"))]
    Obstacle {
        /// The file.
        file: PathBuf,
    },
    /// Something else is among what is to be replaced.
    #[error("{} holds {file}, which was not written with the rest", path.display())]
    #[diagnostic(help("--replace removes the whole folder: move the file away, or choose another folder"))]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// The file, relative to the folder.
        file: String,
    },
    /// What is to be replaced was not written here, or by an early version.
    #[error("{} is there and was not written by this program", path.display())]
    #[diagnostic(help(
        "--replace only takes folders that drape or resolve has written; choose another folder"
    ))]
    NotOurs {
        /// The folder.
        path: PathBuf,
    },
    /// What is to be replaced is being read.
    #[error("{} would be replaced, and {} in it is read", path.display(), input.display())]
    #[diagnostic(help("choose another folder for the output"))]
    Input {
        /// The folder.
        path: PathBuf,
        /// The input.
        input: PathBuf,
    },
    /// Something has come there since the start.
    #[error("while this ran, something else came: {reason}; the result is in {}", instead.display())]
    Meanwhile {
        /// What obstructs it.
        reason: Box<OutputError>,
        /// The folder that was made.
        instead: PathBuf,
    },
    /// The path names no folder that could be made.
    #[error("{} names no new folder", path.display())]
    #[diagnostic(help("give the folder to be made a name, for example -o {}", path.join("drape").display()))]
    NoName {
        /// The path.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("cannot write {}: {reason}", path.display())]
    #[diagnostic(help(
        "check that the folder is writable and the disk is not full; nothing was left behind"
    ))]
    Io {
        /// File or folder.
        path: PathBuf,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// An OBJ or the GLB file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The picture.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A state that cannot be measured.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Draper(#[from] DraperError),
}

/// What is to be shown and written.
#[derive(Clone, Copy)]
pub struct Show<'a> {
    /// What draped it.
    pub draper: &'a Draper,
    /// The garments.
    pub outfit: &'a Outfit,
    /// What it was draped on.
    pub bodies: &'a Bodies,
    /// One drape, or the frames of a motion.
    pub drapes: &'a [Drape],
    /// What temporal smoothing did to them.
    pub smoothing: Option<&'a Smoothing>,
    /// Headline of picture and viewer.
    pub title: &'a str,
    /// Whether every frame of a motion gets its OBJ files, not only the first.
    pub all_frames: bool,
}

/// Writes everything into `folder`, which is made if it is not there.
///
/// # Errors
/// When a file cannot be written, or a state cannot be measured.
pub fn write(folder: &Path, show: &Show) -> Result<Report, OutputError> {
    let refused = |reason| OutputError::Io { path: folder.into(), reason };
    std::fs::create_dir_all(folder).map_err(refused)?;
    let (written, report) = rayon::join(
        || write_files(folder, show),
        || Report::new(show.draper, show.outfit, show.drapes, show.bodies, show.smoothing.cloned()),
    );
    let report = report?;
    for (file, milliseconds) in written? {
        tracing::debug!("{file} in {milliseconds:.0} ms");
    }
    let json = serde_json::to_vec_pretty(&report).map_err(|e| refused(e.into()))?;
    std::fs::write(folder.join("report.json"), json).map_err(refused)?;
    Ok(report)
}

/// Writes everything but the report into `folder`; returns the time of each kind of file (ms).
fn write_files(folder: &Path, show: &Show) -> Result<[(&'static str, f64); 5], OutputError> {
    fn timed<T>(run: impl FnOnce() -> Result<T, OutputError>) -> Result<f64, OutputError> {
        let clock = Instant::now();
        run().map(|_| 1e3 * clock.elapsed().as_secs_f64())
    }
    let meshes = || timed(|| write_meshes(folder, show));
    let caches = || timed(|| write_caches(folder, show));
    let scene = || timed(|| write_scene(&folder.join("scene.glb"), show));
    let picture = || {
        timed(|| {
            crate::picture::save_png(&picture::draw(show), &folder.join("picture.png"))?;
            if show.outfit.garments.len() > 1 {
                crate::picture::save_png(&picture::draw_layers(show), &folder.join("layers.png"))?;
            }
            Ok(())
        })
    };
    let page = || timed(|| viewer::save(&folder.join("viewer.html"), show));
    let ((meshes, (scene, caches)), (picture, page)) =
        rayon::join(|| rayon::join(meshes, || rayon::join(scene, caches)), || rayon::join(picture, page));
    let (caches, scene) = (caches?, scene?);
    Ok([("obj", meshes?), ("glb", scene), ("caches", caches), ("picture", picture?), ("viewer", page?)])
}

/// The vertices of the OBJ files in every frame of a motion.
fn write_caches(folder: &Path, show: &Show) -> Result<(), OutputError> {
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

fn write_meshes(folder: &Path, show: &Show) -> Result<(), OutputError> {
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
fn write_frame(folder: &Path, show: &Show, drape: &Drape) -> Result<Vec<String>, OutputError> {
    let mut lost = Vec::new();
    let body = show.draper.body();
    obj::save(&folder.join("body.obj"), &drape.body, &body.faces, &[format!("body {}", body.name)])?;
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
            Some(moved) => {
                moved.save(folder, &garment.name).map_err(|reason| OutputError::Io { path, reason })?
            }
            None => obj::save_polygons(&path, &positions, source.given.polygons(), &comments)?,
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

fn write_scene(path: &Path, show: &Show) -> Result<(), OutputError> {
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
    Ok(save_glb(path, &meshes, &times)?)
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
