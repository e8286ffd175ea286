//! Garments cut from the clothing helpers of the base mesh: `helper-tights` covers the body from neck to wrists and ankles,
//! `helper-skirt` hangs from the waist to the floor. Both are CC0.

use super::finish::finish;
use clothcombo_data::asset::{Body, Category};
use clothcombo_data::mesh::{BodyClearance, LabelledTriangles, one_rings};
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::vec3::{add, add_scaled, normalized, scale};
use clothcombo_physics::{TriMesh, vertex_normals};

/// Neckline of an upper garment.
#[derive(Clone, Copy, Debug)]
enum Neck {
    /// Round, with this radius beside the neck and this depth in front (m).
    Round { width: f64, depth: f64 },
    /// V-shaped, with the same measures.
    Vee { width: f64, depth: f64 },
    /// Closed around the neck at this height above the neck joint (m).
    Collar(f64),
}

/// Where sleeves end.
#[derive(Clone, Copy, Debug)]
enum Sleeve {
    /// Armhole at the shoulder, this much inside the shoulder joint (m).
    None(f64),
    /// Between shoulder (0), elbow (1) and wrist (2).
    To(f64),
}

/// Where a lower rim lies, as a share of the distance between two joints.
#[derive(Clone, Copy, Debug)]
enum Level {
    /// From the hip joint (0) to the third spine joint (1).
    Trunk(f64),
    /// From the hip joint (0) over the knee (1) to the ankle (2).
    Leg(f64),
}

/// What to cut.
#[derive(Clone, Copy, Debug)]
enum Cut {
    Upper { hem: Level, sleeve: Sleeve, neck: Neck },
    Lower { waist: Level, hem: Level },
    Skirt { waist: Level, hem: Level, flare: f64 },
}

/// One garment: cut and ease (distance added to the helper) at the top and at the hem (m).
struct HelperDesign {
    name: &'static str,
    category: Category,
    cut: Cut,
    ease: [f64; 2],
}

const fn upper(
    name: &'static str,
    category: Category,
    hem: f64,
    sleeve: Sleeve,
    neck: Neck,
    ease: [f64; 2],
) -> HelperDesign {
    HelperDesign { name, category, cut: Cut::Upper { hem: Level::Trunk(hem), sleeve, neck }, ease }
}

const fn lower(name: &'static str, waist: f64, hem: f64, ease: [f64; 2]) -> HelperDesign {
    HelperDesign {
        name,
        category: Category::Trousers,
        cut: Cut::Lower { waist: Level::Trunk(waist), hem: Level::Leg(hem) },
        ease,
    }
}

const fn skirt(name: &'static str, waist: f64, hem: f64, flare: f64, ease: [f64; 2]) -> HelperDesign {
    HelperDesign {
        name,
        category: Category::Skirt,
        cut: Cut::Skirt { waist: Level::Trunk(waist), hem: Level::Leg(hem), flare },
        ease,
    }
}

#[rustfmt::skip]
const DESIGNS: &[HelperDesign] = &[
    upper("helper_tank_top", Category::Top, -0.10, Sleeve::None(0.035), Neck::Round { width: 0.095, depth: 0.10 }, [0.004, 0.010]),
    upper("helper_tank_top_loose", Category::Top, -0.20, Sleeve::None(0.030), Neck::Round { width: 0.100, depth: 0.13 }, [0.010, 0.025]),
    upper("helper_cropped_top", Category::Top, 0.55, Sleeve::None(0.030), Neck::Round { width: 0.100, depth: 0.09 }, [0.004, 0.010]),
    upper("helper_vee_top", Category::Top, 0.00, Sleeve::None(0.020), Neck::Vee { width: 0.090, depth: 0.15 }, [0.006, 0.012]),
    upper("helper_tee", Category::TShirt, -0.20, Sleeve::To(0.50), Neck::Round { width: 0.080, depth: 0.05 }, [0.008, 0.018]),
    upper("helper_tee_fitted", Category::TShirt, 0.00, Sleeve::To(0.35), Neck::Round { width: 0.085, depth: 0.07 }, [0.003, 0.006]),
    upper("helper_tee_loose", Category::TShirt, -0.30, Sleeve::To(0.70), Neck::Round { width: 0.085, depth: 0.05 }, [0.015, 0.035]),
    upper("helper_tee_cropped", Category::TShirt, 0.45, Sleeve::To(0.50), Neck::Round { width: 0.085, depth: 0.06 }, [0.008, 0.020]),
    upper("helper_tee_vee", Category::TShirt, -0.15, Sleeve::To(0.55), Neck::Vee { width: 0.080, depth: 0.12 }, [0.007, 0.014]),
    upper("helper_half_sleeve", Category::TShirt, -0.10, Sleeve::To(1.00), Neck::Round { width: 0.085, depth: 0.06 }, [0.008, 0.014]),
    upper("helper_long_sleeve", Category::TShirt, -0.15, Sleeve::To(1.90), Neck::Round { width: 0.080, depth: 0.05 }, [0.007, 0.014]),
    upper("helper_long_sleeve_loose", Category::TShirt, -0.25, Sleeve::To(1.85), Neck::Round { width: 0.085, depth: 0.05 }, [0.014, 0.028]),
    upper("helper_turtleneck", Category::TShirt, -0.10, Sleeve::To(1.92), Neck::Collar(0.035), [0.004, 0.008]),
    upper("helper_open_shirt", Category::OpenShirt, -0.25, Sleeve::To(1.85), Neck::Round { width: 0.085, depth: 0.06 }, [0.012, 0.025]),
    upper("helper_open_shirt_short", Category::OpenShirt, -0.15, Sleeve::To(0.60), Neck::Round { width: 0.085, depth: 0.07 }, [0.012, 0.022]),
    upper("helper_bolero", Category::OpenShirt, 0.40, Sleeve::To(1.00), Neck::Round { width: 0.090, depth: 0.08 }, [0.008, 0.015]),
    upper("helper_vest", Category::OpenShirt, -0.05, Sleeve::None(0.015), Neck::Vee { width: 0.090, depth: 0.12 }, [0.010, 0.018]),
    lower("helper_hot_pants", 0.20, 0.32, [0.004, 0.008]),
    lower("helper_shorts", 0.25, 0.60, [0.006, 0.016]),
    lower("helper_bermudas", 0.25, 0.92, [0.006, 0.018]),
    lower("helper_capri", 0.30, 1.35, [0.005, 0.012]),
    lower("helper_leggings", 0.25, 1.88, [0.003, 0.004]),
    lower("helper_trousers", 0.30, 1.90, [0.006, 0.020]),
    lower("helper_trousers_high", 0.50, 1.85, [0.005, 0.014]),
    lower("helper_trousers_wide", 0.30, 1.88, [0.008, 0.035]),
    skirt("helper_skirt_mini", 0.30, 0.45, 0.10, [0.003, 0.010]),
    skirt("helper_skirt_flared", 0.35, 0.70, 0.40, [0.003, 0.010]),
    skirt("helper_skirt_knee", 0.30, 1.00, 0.05, [0.003, 0.010]),
    skirt("helper_skirt_midi", 0.40, 1.35, 0.15, [0.003, 0.010]),
    skirt("helper_skirt_long", 0.30, 1.85, 0.10, [0.003, 0.010]),
];

/// A helper garment, or why there is none.
pub(super) struct HelperGarment {
    pub name: &'static str,
    pub category: Category,
    pub result: Result<(TriMesh, BodyClearance), String>,
}

/// Cuts every design from the two helper meshes, given at the zero body in T-pose.
pub(super) fn cut_helpers<'a>(
    tights: &'a LabelledTriangles,
    skirt: &'a LabelledTriangles,
    body: &Body,
    surface: &'a Surface<f64>,
) -> impl ExactSizeIterator<Item = HelperGarment> + use<'a> {
    let marks = Marks::new(body);
    DESIGNS.iter().map(move |design| HelperGarment {
        name: design.name,
        category: design.category,
        result: cut(design, tights, skirt, &marks)
            .and_then(|sheet| finish(ease(sheet, design, &marks, surface), surface)),
    })
}

/// Joint positions that patterns refer to.
struct Marks {
    hip: [f64; 3],
    knee: [f64; 3],
    ankle: [f64; 3],
    chest: [f64; 3],
    neck: [f64; 3],
    shoulder: [f64; 3],
    elbow: [f64; 3],
    wrist: [f64; 3],
}

impl Marks {
    fn new(body: &Body) -> Self {
        let [hip, knee, ankle, chest, neck, shoulder, elbow, wrist] =
            [1, 4, 7, 9, 12, 16, 18, 20].map(|joint: usize| body.joint_template[joint]);
        Self { hip, knee, ankle, chest, neck, shoulder, elbow, wrist }
    }

    fn height(&self, level: Level) -> f64 {
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        match level {
            Level::Trunk(t) => mix(self.hip[1], self.chest[1], t),
            Level::Leg(t) if t <= 1.0 => mix(self.hip[1], self.knee[1], t),
            Level::Leg(t) => mix(self.knee[1], self.ankle[1], t - 1.0),
        }
    }
}

fn cut(
    design: &HelperDesign,
    tights: &LabelledTriangles,
    skirt: &LabelledTriangles,
    marks: &Marks,
) -> Result<LabelledTriangles, String> {
    let pieces = match design.cut {
        Cut::Upper { hem, sleeve, neck } => {
            let hem = marks.height(hem);
            let mut sheet = tights.clip(|p| p[1] - hem, 1).clip(|p| neckline(marks, neck, p), 2);
            sheet = sheet.clip(|p| sleeve_end(marks, sleeve, p), 4);
            if design.category == Category::OpenShirt {
                let middle = marks.neck[2];
                sheet = sheet.clip(|p| (p[0].abs() - 0.012).max(middle - p[2]), 8);
            }
            sheet
        }
        Cut::Lower { waist, hem } => {
            let (waist, hem) = (marks.height(waist), marks.height(hem));
            // Arms and trunk go with the waist cut; hands of the T-pose lie above it.
            tights.clip(|p| waist - p[1], 1).clip(|p| p[1] - hem, 2)
        }
        Cut::Skirt { waist, hem, .. } => {
            let (waist, hem) = (marks.height(waist), marks.height(hem));
            let top = skirt.positions.iter().map(|p| p[1]).fold(f64::MIN, f64::max) - 0.002;
            skirt.clip(|p| waist.min(top) - p[1], 1).clip(|p| p[1] - hem, 2)
        }
    };
    let sheet = pieces.largest_component();
    if sheet.faces.len() < 20 {
        return Err("nothing is left after cutting".into());
    }
    Ok(sheet)
}

/// Positive outside the neck opening.
fn neckline(marks: &Marks, neck: Neck, p: [f64; 3]) -> f64 {
    // The base of the neck: the opening is an ellipse in the frontal plane whose lower end is deeper in front than behind.
    let base = marks.neck[1] + 0.005;
    let front = p[2] > marks.neck[2] + 0.01;
    match neck {
        Neck::Collar(height) => marks.neck[1] + height - p[1],
        Neck::Round { width, depth } => {
            let depth = if front { depth } else { 0.25 * depth };
            let below = (base + 0.02 - p[1]).max(0.0) / (depth + 0.02);
            let q = (p[0] / width).hypot(below);
            (q - 1.0) * width
        }
        Neck::Vee { width, depth } => {
            let depth = if front { depth } else { 0.2 * depth };
            let below = (base + 0.02 - p[1]).max(0.0) / (depth + 0.02);
            (p[0].abs() / width + below - 1.0) * width
        }
    }
}

/// Positive on the trunk's side of the sleeve end.
fn sleeve_end(marks: &Marks, sleeve: Sleeve, p: [f64; 3]) -> f64 {
    let x = p[0].abs();
    match sleeve {
        // An armhole leans outwards below the shoulder, so that it passes under the armpit.
        Sleeve::None(inset) => marks.shoulder[0] - inset + 0.35 * (marks.shoulder[1] - p[1]).max(0.0) - x,
        Sleeve::To(t) if t <= 1.0 => marks.shoulder[0] + t * (marks.elbow[0] - marks.shoulder[0]) - x,
        Sleeve::To(t) => marks.elbow[0] + (t - 1.0) * (marks.wrist[0] - marks.elbow[0]) - x,
    }
}

/// Widens the cut sheet by its ease, growing from top to hem, and flares skirts.
fn ease(
    mut sheet: LabelledTriangles,
    design: &HelperDesign,
    marks: &Marks,
    surface: &Surface<f64>,
) -> LabelledTriangles {
    let (top, bottom) =
        sheet.positions.iter().fold((f64::MIN, f64::MAX), |(t, b), p| (f64::max(t, p[1]), f64::min(b, p[1])));
    let length = (top - bottom).max(1e-6);
    if let Cut::Skirt { flare, .. } = design.cut {
        // Flare turns the cloth about the waist; the axis runs through the middle of the body.
        let middle = sheet.positions.iter().map(|p| p[2]).sum::<f64>() / sheet.positions.len() as f64;
        for p in &mut sheet.positions {
            let grow = 1.0 + flare * (top - p[1]) / 0.4;
            p[0] *= grow;
            p[2] = middle + (p[2] - middle) * grow;
        }
    }
    // Smoothed normals, so that folds of the helper do not open like fans.
    let rings = one_rings(sheet.positions.len(), &sheet.faces);
    let mut normals = vertex_normals(&sheet.positions, &sheet.faces);
    for _ in 0..4 {
        normals = normals
            .iter()
            .zip(&rings)
            .map(|(n, ring)| {
                normalized(ring.iter().fold(*n, |sum, k| add(sum, scale(normals[*k as usize], 0.5))))
            })
            .collect();
    }
    let leg = matches!(design.cut, Cut::Lower { .. });
    let [at_top, at_hem] = design.ease;
    for (p, n) in sheet.positions.iter_mut().zip(&normals) {
        let t = (top - p[1]) / length;
        let wanted = at_top + (at_hem - at_top) * t;
        let gap = surface.gap(*p, Distance::ClosestPoint).gap;
        let side = p[0].signum();
        // The helper is already a little off the body: add what is missing to the ease.
        let step = if !matches!(design.cut, Cut::Skirt { .. }) { (wanted - gap).max(0.0) } else { wanted };
        *p = add_scaled(*p, step, *n);
        if leg && p[1] < marks.hip[1] - 0.10 && p[0] * side < 0.003 {
            // Trouser legs do not reach through each other.
            p[0] = 0.003 * side;
        }
    }
    sheet
}
