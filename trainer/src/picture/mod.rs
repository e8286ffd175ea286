//! Pictures. In: positions, faces and numbers. Out: shaded renders of bodies and garments, labelled sheets of them,
//! charts; all made without a GPU.
//!
//! Nothing here knows a network or a dataset: positions and faces come in as plain slices, pictures go out as
//! [`image::RgbImage`], and [`save_png`] writes them whole or not at all. Input that cannot be drawn (a vertex that
//! is not finite, a face that names no vertex) is left out of the picture: a training run must not end because one
//! of its samples is ugly.

mod figure;
mod outfits;
mod palette;
mod render;
mod save;
mod shade;
mod sheet;
pub(crate) mod svg;

pub mod camera;
pub mod chart;

pub use camera::{Camera, View};
pub use figure::Figure;
pub use outfits::{DressedRow, MeshSlices, draw_dressed};
pub use palette::{BODY_COLOUR, LAYER_COLOURS, layer_colour};
pub use render::{render, render_with_camera};
pub use save::{png_bytes, save_png};
pub use sheet::{LegendEntry, PictureSheet, SheetRow};

use std::path::PathBuf;

/// Why a picture could not be made or written.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file or its folder cannot be written.
    #[error(
        "cannot write picture {path}: {source} (is the folder there, writable and on a disk with free space?)"
    )]
    Write {
        /// The picture that was to be written.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The target names no file.
    #[error(
        "cannot write a picture to {path}: the path ends in no file name (write for example {path}/picture.png)"
    )]
    NoFileName {
        /// The path as given.
        path: PathBuf,
    },
    /// The PNG encoder refused the picture.
    #[error("cannot encode a picture of {width}x{height} pixels as PNG: {source}")]
    Encode {
        /// Width (pixels).
        width: u32,
        /// Height (pixels).
        height: u32,
        /// What the encoder said.
        source: image::ImageError,
    },
}
