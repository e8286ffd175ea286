//! Shaded pictures of body and garments with the software rasteriser `euc`.
//!
//! Two passes: `euc` rasterises every figure into a buffer of (figure, side, normal) with a depth buffer, several
//! samples per pixel; [`super::shade`] then lights only what is visible and averages the samples. The picture is cut
//! into a fixed number of horizontal bands which are rasterised in parallel, so it does not depend on the number of
//! threads.

use clothcombo_physics::vertex_normals;
use euc::{Interpolate, Pipeline, buffer::Buffer2d, rasterizer};
use image::RgbImage;
use rayon::prelude::*;

use super::camera::{Camera, Projected, View};
use super::figure::Figure;
use super::shade::{SurfaceSample, SurfaceSamples, shade};

/// Bands rasterised in parallel; fixed, because rounding inside a triangle depends on the band's origin.
const BANDS: usize = 8;
/// Samples per pixel along each axis while the picture stays below [`SAMPLE_LIMIT`].
const SUPERSAMPLING: u32 = 2;
/// Samples of the whole picture above which it is drawn with one sample per pixel (samples).
const SAMPLE_LIMIT: u64 = 1 << 25;
/// Largest side of a picture (pixels).
const SIDE_LIMIT: u32 = 16_384;
/// Bounding boxes one figure may fill, in pictures. Only cloth that has blown up needs more; without the limit its
/// thousands of picture-sized triangles would take minutes.
const FILL_BUDGET: f64 = 24.0;
/// Distance from the middle of the picture (half pictures) beyond which a vertex is not drawn: the rasteriser counts
/// pixels in 32 bits and must never see one that does not fit.
const NDC_REACH: f64 = 1000.0;
/// In place of a vertex that is not drawn; no face refers to it.
const NOWHERE: Projected = Projected { ndc: [0.0; 2], depth: 2.0 };

/// Draws `figures` into a picture of `size` = [width, height] pixels, framing the first one (see [`Camera::framing`]).
///
/// Order matters only for framing. Sides are limited to 1…16,384 pixels. Nothing to draw gives the background.
pub fn render(figures: &[Figure<'_>], view: View, size: [u32; 2]) -> RgbImage {
    render_with_camera(figures, &Camera::framing(figures, view, size), size)
}

/// As [`render`], from a given camera, so that several pictures can be laid over each other.
pub fn render_with_camera(figures: &[Figure<'_>], camera: &Camera, size: [u32; 2]) -> RgbImage {
    let [width, height] = size.map(|side| side.clamp(1, SIDE_LIMIT));
    let pixels = u64::from(width) * u64::from(height);
    let wanted = u64::from(SUPERSAMPLING * SUPERSAMPLING);
    let supersampling = if pixels * wanted <= SAMPLE_LIMIT { SUPERSAMPLING } else { 1 };
    let sample_size = [width * supersampling, height * supersampling].map(|side| side as usize);

    let meshes: Vec<ProjectedMesh> =
        figures.par_iter().map(|figure| ProjectedMesh::new(figure, camera, sample_size)).collect();
    let bands: Vec<(Buffer2d<SurfaceSample>, Buffer2d<f32>)> = (0..BANDS)
        .into_par_iter()
        .map(|band| {
            let rows = band * sample_size[1] / BANDS..(band + 1) * sample_size[1] / BANDS;
            rasterise_band(&meshes, sample_size, rows)
        })
        .collect();

    let mut samples = SurfaceSamples {
        size: sample_size,
        supersampling: supersampling as usize,
        pixels_per_metre: camera.pixels_per_metre(height * supersampling) as f32,
        surface: Vec::with_capacity(sample_size[0] * sample_size[1]),
        height: Vec::with_capacity(sample_size[0] * sample_size[1]),
    };
    for (surface, depth) in &bands {
        samples.surface.extend_from_slice(surface.as_ref());
        samples.height.extend_from_slice(depth.as_ref());
    }
    samples.height.par_iter_mut().for_each(|depth| *depth = camera.height_of_depth(f64::from(*depth)) as f32);
    let colours: Vec<[u8; 3]> = figures.iter().map(|figure| figure.colour).collect();
    shade(&samples, &colours)
}

/// A figure as it is projected into the picture.
struct ProjectedMesh {
    /// Per vertex; [`NOWHERE`] for one that is not drawn.
    vertices: Vec<Projected>,
    /// Vertex normals in camera coordinates, from the faces that can be drawn.
    normals: Vec<[f32; 3]>,
    /// Visible faces by side: those that turn their front to the camera, those that turn their back.
    sides: [Vec<[u32; 3]>; 2],
}

impl ProjectedMesh {
    fn new(figure: &Figure<'_>, camera: &Camera, sample_size: [usize; 2]) -> Self {
        let is_near = |p: &Projected| p.ndc.iter().all(|value| value.abs() < NDC_REACH);
        let projected: Vec<Option<Projected>> =
            figure.positions.iter().map(|&p| camera.project(p).filter(is_near)).collect();
        let corners = |face: &[u32; 3]| -> Option<[Projected; 3]> {
            let [a, b, c] = face.map(|vertex| projected.get(vertex as usize).copied().flatten());
            Some([a?, b?, c?])
        };
        let faces: Vec<[u32; 3]> =
            figure.faces.iter().filter(|face| corners(face).is_some()).copied().collect();

        let mut sides = [Vec::new(), Vec::new()];
        let mut budget = FILL_BUDGET;
        for face in &faces {
            let Some([a, b, c]) = corners(face) else { continue };
            let share = picture_share([a.ndc, b.ndc, c.ndc], sample_size);
            if share <= 0.0 || share > budget {
                continue;
            }
            budget -= share;
            let edge = |to: Projected| [to.ndc[0] - a.ndc[0], to.ndc[1] - a.ndc[1]];
            let (ab, ac) = (edge(b), edge(c));
            let turns_back = ab[0] * ac[1] - ab[1] * ac[0] < 0.0;
            sides[usize::from(turns_back)].push(*face);
        }
        let normals = vertex_normals(figure.positions, &faces);
        Self {
            normals: normals.into_iter().map(|n| camera.rotate(n).map(|x| x as f32)).collect(),
            vertices: projected.into_iter().map(|p| p.unwrap_or(NOWHERE)).collect(),
            sides,
        }
    }
}

/// Share of the picture that the bounding box of a triangle covers, a sample at least; 0 when it lies outside.
fn picture_share(corners: [[f64; 2]; 3], sample_size: [usize; 2]) -> f64 {
    let mut share = 1.0;
    for axis in 0..2 {
        let values = corners.map(|corner| corner[axis]);
        let low = values[0].min(values[1]).min(values[2]).max(-1.0);
        let high = values[0].max(values[1]).max(values[2]).min(1.0);
        if high < low {
            return 0.0;
        }
        share *= 0.5 * (high - low) + 1.0 / sample_size[axis] as f64;
    }
    share
}

/// Rasterises every mesh into the given rows of the picture.
fn rasterise_band(
    meshes: &[ProjectedMesh],
    sample_size: [usize; 2],
    rows: std::ops::Range<usize>,
) -> (Buffer2d<SurfaceSample>, Buffer2d<f32>) {
    let size = [sample_size[0], rows.len()];
    let mut surface = Buffer2d::new(size, SurfaceSample::BACKGROUND);
    let mut depth = Buffer2d::new(size, 1.0_f32);
    if rows.is_empty() {
        return (surface, depth);
    }
    // The band sees y from `bottom` to `top` in the picture's device coordinates.
    let height = sample_size[1] as f64;
    let (top, bottom) = (1.0 - 2.0 * rows.start as f64 / height, 1.0 - 2.0 * rows.end as f64 / height);
    for (index, mesh) in meshes.iter().enumerate() {
        for (side, faces) in mesh.sides.iter().enumerate() {
            let is_inside = |face: &&[u32; 3]| {
                let y = face.map(|vertex| mesh.vertices[vertex as usize].ndc[1]);
                y[0].max(y[1]).max(y[2]) >= bottom && y[0].min(y[1]).min(y[2]) <= top
            };
            let corners: Vec<u32> = faces.iter().filter(is_inside).flatten().copied().collect();
            let pass = SurfacePass {
                mesh,
                figure: index.min(usize::from(SurfaceSample::MAX_FIGURE)) as u16,
                is_back: side == 1,
                middle: 0.5 * (top + bottom),
                stretch: 2.0 / (top - bottom),
            };
            pass.draw::<rasterizer::Triangles<_, rasterizer::BackfaceCullingDisabled>, _>(
                &corners,
                &mut surface,
                Some(&mut depth),
            );
        }
    }
    (surface, depth)
}

/// The first pass: one side of one figure into one band.
struct SurfacePass<'a> {
    mesh: &'a ProjectedMesh,
    figure: u16,
    is_back: bool,
    middle: f64,
    stretch: f64,
}

/// Normal in camera coordinates, interpolated over a triangle.
#[derive(Clone)]
struct Normal([f32; 3]);

impl Interpolate for Normal {
    #[inline(always)]
    fn lerp2(a: Self, b: Self, x: f32, y: f32) -> Self {
        Self(std::array::from_fn(|i| a.0[i] * x + b.0[i] * y))
    }

    #[inline(always)]
    fn lerp3(a: Self, b: Self, c: Self, x: f32, y: f32, z: f32) -> Self {
        Self(std::array::from_fn(|i| a.0[i] * x + b.0[i] * y + c.0[i] * z))
    }
}

impl Pipeline for SurfacePass<'_> {
    type Vertex = u32;
    type VsOut = Normal;
    type Pixel = SurfaceSample;

    #[inline(always)]
    fn vert(&self, &vertex: &u32) -> ([f32; 4], Normal) {
        let Projected { ndc, depth } = self.mesh.vertices[vertex as usize];
        let y = (ndc[1] - self.middle) * self.stretch;
        // w = 1: the perspective division is already done in f64, where thin triangles keep their exact depth; depth
        // is linear in 1/distance and so stays exact, and a normal may be interpolated in the picture plane.
        ([ndc[0] as f32, y as f32, depth as f32, 1.0], Normal(self.mesh.normals[vertex as usize]))
    }

    #[inline(always)]
    fn frag(&self, normal: &Normal) -> SurfaceSample {
        SurfaceSample::new(self.figure, self.is_back, normal.0)
    }
}

#[cfg(test)]
mod tests;
