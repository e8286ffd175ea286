//! Lighting of a rasterised picture: hemisphere ambient, key and fill light, contact shade in folds and thin outlines
//! where one figure ends on another, so that wrinkles, gaps and penetrations can be judged.

use image::RgbImage;
use rayon::prelude::*;

/// Key light: direction in camera coordinates (right, up, towards the camera) and strength in linear RGB.
const KEY_LIGHT: ([f32; 3], [f32; 3]) = ([-0.58, 0.52, 0.63], [0.74, 0.72, 0.68]);
/// Fill light from the other side, weaker and cooler.
const FILL_LIGHT: ([f32; 3], [f32; 3]) = ([0.80, 0.10, 0.59], [0.15, 0.165, 0.185]);
/// Ambient light from above and from below.
const SKY: [f32; 3] = [0.32, 0.33, 0.35];
const GROUND: [f32; 3] = [0.16, 0.15, 0.14];
/// Light the back of a surface keeps, and how far its colour goes to grey.
const BACK_LIGHT: f32 = 0.36;
const BACK_GREY: f32 = 0.35;
/// Reach of contact shade (m) and its strength.
const CONTACT_REACH: f32 = 0.04;
const CONTACT_STRENGTH: f32 = 1.9;
/// Samples of contact shade around each visible sample.
const CONTACT_SAMPLES: usize = 10;
/// Step towards the camera that draws an outline within one figure (m), and what an outline leaves of the light.
const OUTLINE_STEP: f32 = 0.015;
const OUTLINE_LIGHT: f32 = 0.58;
/// Background: middle and edge of the picture (sRGB).
const BACKGROUND: [[f32; 3]; 2] = [[243.0, 243.0, 241.0], [216.0, 219.0, 222.0]];

/// What a sample of the picture shows: figure, side and normal in six bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SurfaceSample {
    /// x and y of the unit normal turned to the camera, 32767 = 1.
    normal: [i16; 2],
    /// Figure index × 2 + (1 for the back of the surface).
    surface: u16,
}

impl SurfaceSample {
    /// No figure.
    pub(super) const BACKGROUND: Self = Self { normal: [0; 2], surface: u16::MAX };
    /// Figures beyond this one share its number.
    pub(super) const MAX_FIGURE: u16 = u16::MAX / 2 - 1;

    /// `normal` as interpolated: of any length, in camera coordinates; on a back it points away and is turned round.
    #[inline(always)]
    pub(super) fn new(figure: u16, is_back: bool, normal: [f32; 3]) -> Self {
        let sign = if is_back { -1.0 } else { 1.0 };
        let [x, y, z] = normal.map(|value| value * sign);
        // A smooth normal can lean away at the outline of a surface whose face still shows: bend it to the rim.
        let z = z.max(0.0);
        let length = (x * x + y * y + z * z).sqrt();
        let scale = if length > 1e-12 { 32_767.0 / length } else { 0.0 };
        Self { normal: [(x * scale) as i16, (y * scale) as i16], surface: 2 * figure + u16::from(is_back) }
    }

    fn is_background(self) -> bool {
        self.surface == u16::MAX
    }

    pub(super) fn figure(self) -> u16 {
        self.surface / 2
    }

    fn is_back(self) -> bool {
        self.surface % 2 == 1
    }

    fn normal(self) -> [f32; 3] {
        let [x, y] = self.normal.map(|value| f32::from(value) / 32_767.0);
        [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
    }
}

/// A rasterised picture before lighting.
pub(super) struct SurfaceSamples {
    /// Width and height (samples).
    pub(super) size: [usize; 2],
    /// Samples per pixel along each axis.
    pub(super) supersampling: usize,
    /// Samples per metre.
    pub(super) pixels_per_metre: f32,
    /// Row-major.
    pub(super) surface: Vec<SurfaceSample>,
    /// Distance towards the camera (m), row-major.
    pub(super) height: Vec<f32>,
}

/// Lights the visible samples and averages them, in linear light, to pixels.
pub(super) fn shade(samples: &SurfaceSamples, colours: &[[u8; 3]]) -> RgbImage {
    let factor = samples.supersampling;
    let (width, height) = (samples.size[0] / factor, samples.size[1] / factor);
    let palette: Vec<[[f32; 3]; 2]> = colours.iter().map(|&colour| sides(colour)).collect();
    let offsets = contact_offsets(samples.pixels_per_metre);
    let lights = [KEY_LIGHT, FILL_LIGHT].map(|(direction, strength)| (unit(direction), strength));
    let half_vector = unit([lights[0].0[0], lights[0].0[1], lights[0].0[2] + 1.0]);
    let scale = 1.0 / (factor * factor) as f32;

    let mut bytes = vec![0_u8; width * height * 3];
    bytes.par_chunks_mut(width * 3).enumerate().for_each(|(row, line)| {
        for (column, pixel) in line.chunks_exact_mut(3).enumerate() {
            let background = background([column, row], [width, height]);
            let mut sum = [0.0_f32; 3];
            for y in row * factor..(row + 1) * factor {
                for x in column * factor..(column + 1) * factor {
                    let sample = samples.surface[y * samples.size[0] + x];
                    let light = match palette.get(usize::from(sample.figure())) {
                        Some(sides) if !sample.is_background() => {
                            let albedo = sides[usize::from(sample.is_back())];
                            let openness = contact(samples, &offsets, x, y) * outline(samples, x, y);
                            lit(sample.normal(), albedo, openness, &lights, half_vector)
                        }
                        _ => background,
                    };
                    (0..3).for_each(|channel| sum[channel] += light[channel]);
                }
            }
            for channel in 0..3 {
                pixel[channel] = to_srgb(sum[channel] * scale);
            }
        }
    });
    RgbImage::from_raw(width as u32, height as u32, bytes).unwrap_or_default()
}

/// Light that leaves a surface point towards the camera.
fn lit(
    normal: [f32; 3],
    albedo: [f32; 3],
    openness: f32,
    lights: &[([f32; 3], [f32; 3]); 2],
    half_vector: [f32; 3],
) -> [f32; 3] {
    let up = 0.5 * (normal[1] + 1.0);
    let diffuse = lights.map(|(direction, _)| dot(normal, direction).max(0.0));
    let sheen = 0.05 * dot(normal, half_vector).max(0.0).powi(24);
    let rim = 0.05 * (1.0 - normal[2]).powi(3);
    std::array::from_fn(|channel| {
        let ambient = GROUND[channel] + (SKY[channel] - GROUND[channel]) * up;
        let direct = diffuse[0] * lights[0].1[channel] + diffuse[1] * lights[1].1[channel];
        // Contact shade takes all of the ambient light and part of the direct light, or folds would stay flat.
        let incoming = ambient * openness + direct * (0.35 + 0.65 * openness);
        albedo[channel] * incoming + (sheen + rim) * openness
    })
}

/// Offsets (samples) of the contact-shade samples in four turns, one per position in a 2×2 block, so that averaging
/// over a pixel multiplies their number.
fn contact_offsets(pixels_per_metre: f32) -> [Vec<[i32; 2]>; 4] {
    // A wild camera (everything in one point, or kilometres wide) must not sample the whole picture or one sample.
    let reach = (CONTACT_REACH * pixels_per_metre).clamp(3.0, 96.0);
    std::array::from_fn(|turn| {
        (0..CONTACT_SAMPLES)
            .map(|k| {
                let share = (k as f32 + 0.5 + 0.25 * (turn as f32 - 1.5)) / CONTACT_SAMPLES as f32;
                // The golden angle spreads directions evenly; a power of 1.5 puts more samples close by.
                let angle = 2.399_963 * k as f32 + std::f32::consts::FRAC_PI_2 * turn as f32 * 0.61;
                let radius = 1.0 + reach * share.max(0.0).powf(1.5);
                [(radius * angle.cos()).round() as i32, (radius * angle.sin()).round() as i32]
            })
            .collect()
    })
}

/// Share of the light from around that reaches a sample: 1 in the open, less in folds and next to a nearer layer.
fn contact(samples: &SurfaceSamples, offsets: &[Vec<[i32; 2]>; 4], x: usize, y: usize) -> f32 {
    let [width, height] = samples.size;
    let here = samples.height[y * width + x];
    let normal = samples.surface[y * width + x].normal();
    let metres = 1.0 / samples.pixels_per_metre.max(1e-6);
    let reach = CONTACT_REACH;
    let mut shade = 0.0;
    for &[dx, dy] in &offsets[2 * (y % 2) + x % 2] {
        let (sx, sy) = (x as i64 + i64::from(dx), y as i64 + i64::from(dy));
        if sx < 0 || sy < 0 || sx >= width as i64 || sy >= height as i64 {
            continue;
        }
        let index = sy as usize * width + sx as usize;
        if samples.surface[index].is_background() {
            continue;
        }
        let offset = [dx as f32 * metres, -dy as f32 * metres, samples.height[index] - here];
        let squared = dot(offset, offset);
        let above = dot(offset, normal) - 0.0008;
        if above > 0.0 && squared < 4.0 * reach * reach {
            let distance = squared.sqrt();
            shade += (above / (distance + 0.002)) * (1.0 - distance / (2.0 * reach));
        }
    }
    (1.0 - CONTACT_STRENGTH * shade / CONTACT_SAMPLES as f32).clamp(0.12, 1.0)
}

/// [`OUTLINE_LIGHT`] on samples beside another figure or beside a step of one figure; 1 elsewhere.
fn outline(samples: &SurfaceSamples, x: usize, y: usize) -> f32 {
    let [width, height] = samples.size;
    let index = y * width + x;
    let (here, depth) = (samples.surface[index], samples.height[index]);
    let is_step = |other: usize| {
        let neighbour = samples.surface[other];
        // The outline lies on the nearer surface, so that it is one sample wide and never falls on the background.
        !neighbour.is_background()
            && (neighbour.surface != here.surface || depth - samples.height[other] > OUTLINE_STEP)
            && depth >= samples.height[other]
    };
    let beside = (x > 0 && is_step(index - 1))
        || (x + 1 < width && is_step(index + 1))
        || (y > 0 && is_step(index - width))
        || (y + 1 < height && is_step(index + width));
    if beside { OUTLINE_LIGHT } else { 1.0 }
}

/// Linear colour of the front and of the back of a surface.
fn sides(colour: [u8; 3]) -> [[f32; 3]; 2] {
    let front = colour.map(|value| to_linear(f32::from(value)));
    let grey = dot(front, [0.2126, 0.7152, 0.0722]);
    [front, front.map(|value| BACK_LIGHT * (value + BACK_GREY * (grey - value)))]
}

/// Linear light of the background at a pixel: a soft glow behind the figure.
fn background([x, y]: [usize; 2], [width, height]: [usize; 2]) -> [f32; 3] {
    let u = (x as f32 + 0.5) / width as f32 - 0.5;
    let v = (y as f32 + 0.5) / height as f32 - 0.45;
    let share = (1.9 * (u * u + v * v)).min(1.0);
    std::array::from_fn(|channel| {
        let [middle, edge] = BACKGROUND.map(|colour| colour[channel]);
        to_linear(middle + (edge - middle) * share)
    })
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

/// sRGB (0…255) to linear light. A pure power and its exact inverse: quick, and nobody sees the difference.
fn to_linear(value: f32) -> f32 {
    let v = value / 255.0;
    // 2.2 ≈ 2 + 1/5: between v² and v³, within half a grey level of the power.
    v * v * (0.8 + 0.2 * v)
}

/// Linear light to sRGB (0…255), the inverse of [`to_linear`].
fn to_srgb(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    // Two Newton steps from the square root invert the cubic to far less than a grey level.
    let mut v = light.sqrt();
    for _ in 0..2 {
        let value = v * v * (0.8 + 0.2 * v) - light;
        v -= value / (v * (1.6 + 0.6 * v)).max(1e-3);
    }
    (v * 255.0 + 0.5).clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_and_linear_light_are_inverse() {
        for value in 0..=255_u8 {
            assert_eq!(to_srgb(to_linear(f32::from(value))), value);
            let power = (f32::from(value) / 255.0).powf(2.2);
            assert!((to_linear(f32::from(value)) - power).abs() < 0.02);
        }
    }

    #[test]
    fn samples_keep_figure_side_and_normal() {
        for (figure, is_back, sign) in
            [(0, false, 1.0), (3, true, -1.0), (SurfaceSample::MAX_FIGURE, true, -1.0)]
        {
            let sample = SurfaceSample::new(figure, is_back, [0.9 * sign, -1.2 * sign, 2.0 * sign]);
            assert!(!sample.is_background());
            assert_eq!((sample.figure(), sample.is_back()), (figure, is_back));
            let [x, y, z] = sample.normal();
            assert!((x - 0.36).abs() < 1e-3 && (y + 0.48).abs() < 1e-3 && (z - 0.8).abs() < 1e-3);
        }
        let undefined = SurfaceSample::new(1, false, [f32::NAN, 0.0, 1.0]);
        assert!(undefined.normal().iter().all(|x| x.is_finite()));
    }

    #[test]
    fn a_step_shades_the_lower_side_only() {
        let size = [64, 64];
        let surface = vec![SurfaceSample::new(0, false, [0.0, 0.0, 1.0]); 64 * 64];
        let height = (0..64 * 64).map(|i| if i % 64 < 32 { 0.0 } else { 0.02 }).collect();
        let samples = SurfaceSamples { size, supersampling: 2, pixels_per_metre: 400.0, surface, height };
        let offsets = contact_offsets(samples.pixels_per_metre);
        let openness = |x| {
            let mut sum = 0.0;
            for y in 30..34 {
                sum += contact(&samples, &offsets, x, y) / 4.0;
            }
            sum
        };
        assert!(openness(30) < 0.9, "beside the step: {}", openness(30));
        assert_eq!(openness(33), 1.0, "on the step");
        assert_eq!(openness(2), 1.0, "far from it");
        assert_eq!(outline(&samples, 32, 30), OUTLINE_LIGHT);
        assert_eq!(outline(&samples, 31, 30), 1.0);
    }
}
