//! What is to be shown and written.

use crate::inference::bodies::Bodies;
use crate::inference::drape::Drape;
use crate::inference::draper::Draper;
use crate::inference::outfit::Outfit;
use crate::inference::smooth::Smoothing;

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
