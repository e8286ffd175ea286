//! Where the picture is taken from.

use super::figure::Figure;

/// What is farther from the centre of the framed figure than this, in its radii, may be cut off.
const NEARBY_IN_RADII: f64 = 1.25;
/// Distance of the camera in radii of the framed figure: far enough that a person keeps natural proportions.
const DISTANCE_IN_RADII: f64 = 5.0;
/// Depth range in radii of the framed figure around its centre; geometry outside is not drawn.
const DEPTH_IN_RADII: f64 = 3.0;
/// Share of the picture the framed figure may fill along its tighter side.
const FRAME_FILL: f64 = 0.9;

/// A direction to look from; the subject faces +z and its left hand points to +x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// The subject's face.
    Front,
    /// The subject's back.
    Back,
    /// The subject's left side.
    Side,
    /// Between front and left side, from slightly above.
    ThreeQuarter,
    /// Any direction (radians): azimuth from the front (+z) towards the subject's left (+x), elevation above level.
    Orbit {
        /// Angle around y.
        azimuth: f64,
        /// Angle above the horizontal plane, kept within ±85°.
        elevation: f64,
    },
}

impl View {
    /// Azimuth and elevation (radians).
    pub fn angles(self) -> (f64, f64) {
        let level = 4_f64.to_radians();
        match self {
            Self::Front => (0.0, level),
            Self::Back => (std::f64::consts::PI, level),
            Self::Side => (std::f64::consts::FRAC_PI_2, level),
            Self::ThreeQuarter => (38_f64.to_radians(), 9_f64.to_radians()),
            Self::Orbit { azimuth, elevation } => {
                let limit = 85_f64.to_radians();
                let finite = |angle: f64| if angle.is_finite() { angle } else { 0.0 };
                (finite(azimuth), finite(elevation).clamp(-limit, limit))
            }
        }
    }

    /// Short English name for labels.
    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Back => "back",
            Self::Side => "side",
            Self::ThreeQuarter => "three-quarter",
            Self::Orbit { .. } => "orbit",
        }
    }
}

/// A slight-perspective camera. One camera shared by several renders makes them comparable pixel by pixel.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Rows: right, up and towards the camera, in world coordinates.
    axes: [[f64; 3]; 3],
    centre: [f64; 3],
    /// From the centre to the eye (m).
    distance: f64,
    /// Depths (m) that map to −1 and +1.
    near: f64,
    far: f64,
    /// Centre and half extents of the picture on the plane at depth 1.
    window_centre: [f64; 2],
    window_half: [f64; 2],
}

/// A point in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Normalised device coordinates: x right, y up, both −1…1 inside the picture.
    pub ndc: [f64; 2],
    /// −1 at the near plane to 1 at the far plane, linear in 1/depth (and so exactly linear over a flat triangle).
    pub depth: f64,
}

impl Camera {
    /// Frames the first figure with anything to draw (the body, where there is one) for a picture of `size` pixels, and what
    /// of the others is near it. What is far does not move the camera: a garment that flies off must not make the person
    /// small.
    pub fn framing(figures: &[Figure<'_>], view: View, size: [u32; 2]) -> Self {
        let (azimuth, elevation) = view.angles();
        let (sin_a, cos_a) = azimuth.sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let axes = [
            [cos_a, 0.0, -sin_a],
            [-sin_a * sin_e, cos_e, -cos_a * sin_e],
            [sin_a * cos_e, sin_e, cos_a * cos_e],
        ];
        let is_finite = |p: &&[f64; 3]| p.iter().all(|x| x.is_finite());
        let framed = figures.iter().find(|figure| figure.positions.iter().any(|p| is_finite(&p)));
        let points = || framed.into_iter().flat_map(|figure| figure.positions.iter().filter(is_finite));

        let [low, high] = bounds(points().copied()).unwrap_or([[-1.0; 3], [1.0; 3]]);
        let centre = std::array::from_fn(|axis| 0.5 * low[axis] + 0.5 * high[axis]);
        let half_diagonal = (0..3).map(|axis| (high[axis] - low[axis]).powi(2)).sum::<f64>().sqrt() / 2.0;
        let radius = half_diagonal.clamp(1e-6, 1e9);
        let aspect = f64::from(size[0].max(1)) / f64::from(size[1].max(1));
        let mut camera = Self {
            axes,
            centre,
            distance: DISTANCE_IN_RADII * radius,
            near: (DISTANCE_IN_RADII - DEPTH_IN_RADII) * radius,
            far: (DISTANCE_IN_RADII + DEPTH_IN_RADII) * radius,
            window_centre: [0.0; 2],
            window_half: [1.0; 2],
        };

        let is_near = |p: &&[f64; 3]| {
            (0..3).map(|k| (p[k] - centre[k]).powi(2)).sum::<f64>().sqrt() <= NEARBY_IN_RADII * radius
        };
        let others =
            figures.iter().flat_map(|figure| figure.positions.iter().filter(is_finite).filter(is_near));
        let seen = points().chain(others).map(|&p| {
            let [x, y, z] = camera.to_camera(p);
            [x, y].map(|value| value / (camera.distance - z).max(camera.near))
        });
        let [window_low, window_high] = bounds(seen).unwrap_or([[-0.2; 2], [0.2; 2]]);
        let half = |axis: usize| (window_high[axis] - window_low[axis]) / (2.0 * FRAME_FILL);
        let vertical = half(1).max(half(0) / aspect).max(1e-9);
        camera.window_centre = std::array::from_fn(|axis| 0.5 * (window_low[axis] + window_high[axis]));
        camera.window_half = [vertical * aspect, vertical];
        camera
    }

    /// Position relative to the framed centre along right, up and towards the camera (m).
    fn to_camera(&self, p: [f64; 3]) -> [f64; 3] {
        let offset: [f64; 3] = std::array::from_fn(|axis| p[axis] - self.centre[axis]);
        self.rotate(offset)
    }

    /// A direction in camera coordinates: right, up, towards the camera.
    pub fn rotate(&self, direction: [f64; 3]) -> [f64; 3] {
        self.axes.map(|row| row[0] * direction[0] + row[1] * direction[1] + row[2] * direction[2])
    }

    /// Where a world position (m) lies in the picture; `None` if it is not finite or outside the depth range.
    pub fn project(&self, p: [f64; 3]) -> Option<Projected> {
        let [x, y, z] = self.to_camera(p);
        let depth = self.distance - z;
        if !(x.is_finite() && y.is_finite() && depth > self.near && depth < self.far) {
            return None;
        }
        let ndc = [
            (x / depth - self.window_centre[0]) / self.window_half[0],
            (y / depth - self.window_centre[1]) / self.window_half[1],
        ];
        let (near, far) = (1.0 / self.near, 1.0 / self.far);
        Some(Projected { ndc, depth: 2.0 * (near - 1.0 / depth) / (near - far) - 1.0 })
    }

    /// Inverse of the depth of [`Self::project`]: distance towards the camera from the framed centre (m).
    pub fn height_of_depth(&self, depth: f64) -> f64 {
        let (near, far) = (1.0 / self.near, 1.0 / self.far);
        self.distance - 1.0 / (near - 0.5 * (depth + 1.0) * (near - far))
    }

    /// Pixels per metre at the framed centre for a picture `height` pixels high.
    pub fn pixels_per_metre(&self, height: u32) -> f64 {
        f64::from(height) / (2.0 * self.window_half[1] * self.distance)
    }
}

/// The least and the largest value along every axis; none without points.
fn bounds<const D: usize>(points: impl Iterator<Item = [f64; D]>) -> Option<[[f64; D]; 2]> {
    let none = [[f64::INFINITY; D], [f64::NEG_INFINITY; D]];
    let [low, high] = points.fold(none, |[low, high], p| {
        [std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))]
    });
    (low[0] <= high[0]).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: [[f64; 3]; 8] = [
        [-0.4, -0.9, -0.1],
        [0.4, -0.9, -0.1],
        [-0.4, 0.8, -0.1],
        [0.4, 0.8, -0.1],
        [-0.4, -0.9, 0.2],
        [0.4, -0.9, 0.2],
        [-0.4, 0.8, 0.2],
        [0.4, 0.8, 0.2],
    ];

    fn figure(positions: &[[f64; 3]]) -> Figure<'_> {
        Figure { positions, faces: &[], colour: [200; 3] }
    }

    #[test]
    fn every_view_frames_the_whole_figure_with_a_margin() {
        let views = [
            View::Front,
            View::Back,
            View::Side,
            View::ThreeQuarter,
            View::Orbit { azimuth: 2.1, elevation: 1.0 },
        ];
        for view in views {
            for size in [[512, 768], [900, 300], [64, 64]] {
                let camera = Camera::framing(&[figure(&BOX)], view, size);
                let mut reach = 0.0_f64;
                for &p in &BOX {
                    let projected = camera.project(p).unwrap();
                    assert!(projected.depth.abs() < 1.0);
                    reach = reach.max(projected.ndc[0].abs()).max(projected.ndc[1].abs());
                }
                assert!((reach - FRAME_FILL).abs() < 1e-9, "{view:?} {size:?}: {reach}");
            }
        }
    }

    #[test]
    fn a_wide_skirt_is_in_the_picture_and_what_flew_off_is_not() {
        let skirt = [[-0.9, -0.5, 0.0], [0.9, -0.5, 0.0], [0.0, -0.5, 0.9]];
        let gone = [[40.0, 0.0, 0.0], [40.0, 1.0, 0.0], [41.0, 0.0, 0.0]];
        for view in [View::Front, View::Side, View::ThreeQuarter] {
            let frame = |figures: &[Figure<'_>]| Camera::framing(figures, view, [512, 768]);
            let dressed = frame(&[figure(&BOX), figure(&skirt)]);
            for p in BOX.iter().chain(&skirt) {
                let [x, y] = dressed.project(*p).unwrap().ndc;
                assert!(x.abs().max(y.abs()) <= FRAME_FILL + 1e-9, "{view:?} {p:?}");
            }
            let [alone, beside] = [frame(&[figure(&BOX)]), frame(&[figure(&BOX), figure(&gone)])];
            assert_eq!(alone.pixels_per_metre(100), beside.pixels_per_metre(100));
            assert!(dressed.pixels_per_metre(100) <= alone.pixels_per_metre(100));
        }
    }

    #[test]
    fn left_hand_is_right_in_front_and_left_in_back_and_nearer_is_less_deep() {
        let hand = [0.4, 0.0, 0.0];
        let front = Camera::framing(&[figure(&BOX)], View::Front, [100, 100]);
        let back = Camera::framing(&[figure(&BOX)], View::Back, [100, 100]);
        let side = Camera::framing(&[figure(&BOX)], View::Side, [100, 100]);
        assert!(front.project(hand).unwrap().ndc[0] > 0.1);
        assert!(back.project(hand).unwrap().ndc[0] < -0.1);
        let depth = |camera: &Camera, p| camera.project(p).unwrap().depth;
        assert!(depth(&front, [0.0, 0.0, 0.2]) < depth(&front, [0.0, 0.0, -0.1]));
        assert!(depth(&back, [0.0, 0.0, 0.2]) > depth(&back, [0.0, 0.0, -0.1]));
        assert!(depth(&side, hand) < depth(&side, [-0.4, 0.0, 0.0]));
    }

    #[test]
    fn depth_inverts_and_is_fine_enough_for_single_precision() {
        let camera = Camera::framing(&[figure(&BOX)], View::Front, [512, 768]);
        for z in [-0.1, 0.0, 0.05, 0.2] {
            let p = [0.1, 0.3, z];
            let projected = camera.project(p).unwrap();
            let height = camera.height_of_depth(f64::from(projected.depth as f32));
            assert!(
                (height - camera.to_camera(p)[2]).abs() < 1e-5,
                "a hundredth of a millimetre must survive f32"
            );
        }
    }

    #[test]
    fn nothing_to_frame_and_wild_positions_are_no_problem() {
        let wild = [[f64::NAN, 0.0, 0.0], [f64::INFINITY, 1.0, 2.0]];
        for figures in
            [&[][..], &[figure(&[])][..], &[figure(&wild)][..], &[figure(&[[1e300, 0.0, -1e300]])][..]]
        {
            let camera = Camera::framing(figures, View::Front, [0, 0]);
            assert!(camera.project([f64::NAN; 3]).is_none());
            assert!(camera.pixels_per_metre(100).is_finite());
        }
        let camera = Camera::framing(&[figure(&wild), figure(&BOX)], View::Front, [9, 9]);
        assert!(camera.project(BOX[0]).is_some(), "the first figure with a finite vertex is framed");
    }
}
