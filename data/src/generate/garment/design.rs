//! What may differ between two garments: the documented parameters of each category.
//!
//! Lengths along the body are on one scale for all categories, so that a design fits any body: 0 is the waist, 1 the
//! crotch, 2 the ankle. Along an arm, 0 is the shoulder and 1 the wrist. Ease is what the cloth is wider than the body,
//! in metres of radius. Where a value would make a garment impossible on a body (a hem above the crotch of trousers,
//! pleats finer than the triangles), cutting uses the nearest possible one.

use crate::asset::Category;

/// The design of one garment, without its mesh.
#[derive(Debug, Clone)]
pub enum GarmentDesign {
    /// A skirt.
    Skirt(SkirtDesign),
    /// Trousers.
    Trousers(TrousersDesign),
    /// Everything that covers the chest: dress, top, T-shirt, open shirt.
    Upper(UpperDesign),
}

impl GarmentDesign {
    /// The category the garment belongs to.
    pub fn category(&self) -> Category {
        match self {
            Self::Skirt(_) => Category::Skirt,
            Self::Trousers(_) => Category::Trousers,
            Self::Upper(upper) => upper.category,
        }
    }
}

/// A tube from the waist down.
#[derive(Debug, Clone)]
pub struct SkirtDesign {
    /// Height of the rim: 0 low on the hips, 1 at the waist.
    pub rise: f64,
    /// Hem on the length scale, 1.1–1.95.
    pub length: f64,
    /// Ease at the hips (m), 6–16 mm.
    pub ease: f64,
    /// Share by which the outline falls straight below the widest place instead of following the body, 0–1.
    pub hang: f64,
    /// Flare and pleats.
    pub skirt: FlareDesign,
    /// Slope of the rim from back to front (m/m), ±0.08.
    pub rim_tilt: f64,
    /// Slope of the hem from back to front (m/m), ±0.04.
    pub hem_tilt: f64,
}

/// Two legs and a seat.
#[derive(Debug, Clone)]
pub struct TrousersDesign {
    /// Height of the rim: 0 low on the hips, 1 at the waist.
    pub rise: f64,
    /// Hem on the length scale, 1.1 (hot pants) – 1.97.
    pub length: f64,
    /// How far the crotch seam hangs below the body (m), 12–35 mm.
    pub drop: f64,
    /// Ease of the seat (m), 6–18 mm.
    pub ease: f64,
    /// Ease of the legs (m), 7–24 mm.
    pub leg_ease: f64,
    /// Share by which the legs fall straight from the thigh, 0–1: tights to straight legs.
    pub hang: f64,
    /// Extra radius at the ankle (m), −10 (tapered) – 70 mm (bell bottoms), growing from the knee.
    pub flare: f64,
    /// Share by which the last 5 cm are gathered to the leg, 0 (hem) – 1 (cuff).
    pub cuff: f64,
    /// Slope of the rim from back to front (m/m), ±0.08.
    pub rim_tilt: f64,
}

/// A garment hung from the shoulders or the chest.
#[derive(Debug, Clone)]
pub struct UpperDesign {
    /// Dress, top, T-shirt or open shirt.
    pub category: Category,
    /// Hem on the length scale: dresses 1.1–1.95, the others 0–1.15.
    pub length: f64,
    /// From tight (0) to loose (1): 7–29 mm of ease around the chest, and as much straight fall.
    pub looseness: f64,
    /// Share by which the outline falls straight from the waist down, 0–1.
    pub hang: f64,
    /// Flare and pleats below the waist.
    pub skirt: FlareDesign,
    /// Slope of the hem from back to front (m/m), ±0.1.
    pub hem_tilt: f64,
    /// The upper edge.
    pub neckline: Neckline,
    /// Sleeves, or armholes where there are none.
    pub sleeves: Option<SleeveDesign>,
    /// How the front opens.
    pub front: Front,
}

/// How the outline of a skirt leaves the body.
#[derive(Debug, Clone)]
pub struct FlareDesign {
    /// Extra radius per metre of height (m/m), 0–0.55.
    pub flare: f64,
    /// Folds around the hem.
    pub pleats: Option<PleatDesign>,
}

/// Regular folds around a skirt.
#[derive(Debug, Clone)]
pub struct PleatDesign {
    /// Number around the skirt, 6–28; fewer where a pleat would be narrower than six edges.
    pub count: u32,
    /// Height of a fold from valley to ridge as a share of its width, 0–0.25.
    pub depth: f64,
    /// Where between waist and hem they are fully formed: near 0 pressed from the waistband on, 1 soft folds at the hem.
    pub formed: f64,
    /// Angle of the first ridge (rad).
    pub phase: f64,
}

/// The upper edge of an upper garment.
#[derive(Debug, Clone)]
pub enum Neckline {
    /// A level edge below the armpits.
    Strapless {
        /// Distance below the armpit (m), 25–50 mm.
        drop: f64,
        /// Slope from back to front (m/m), ±0.06.
        tilt: f64,
    },
    /// An opening for the neck, with shoulders or straps.
    Neck {
        /// Half the opening beyond the side of the neck (m), 24–90 mm; narrower where the strap needs the width.
        width: f64,
        /// Depth in front below the base of the neck (m), 5–110 mm.
        depth: f64,
        /// Depth at the back (m), 0–50 mm.
        depth_back: f64,
        /// Shape: 1 a V, 2 round, 3 and more square.
        power: f64,
        /// Where the armhole cuts the shoulder, as a share of the shoulder's width, 0.8–0.97; with sleeves it only limits
        /// the opening.
        armhole: f64,
        /// How far an armhole without sleeve reaches below the armpit (m), 15–35 mm.
        armhole_drop: f64,
    },
}

/// A pair of sleeves.
#[derive(Debug, Clone)]
pub struct SleeveDesign {
    /// End of the sleeve: 0 at the shoulder, 1 at the wrist; 0.2–0.97.
    pub length: f64,
    /// Ease beyond that of the looseness (m), 0–6 mm.
    pub ease: f64,
    /// Share by which the sleeve keeps its width towards the wrist, 0–0.8.
    pub hang: f64,
    /// Extra radius at the end (m), −4 – 35 mm, growing from the shoulder.
    pub flare: f64,
    /// Extra radius at the armhole (m), 0–12 mm.
    pub armhole: f64,
    /// Slope of the edge (m/m), ±0.15.
    pub tilt: f64,
    /// Share by which the last 5 cm are gathered to the arm, 0 (open edge) – 1 (cuff).
    pub cuff: f64,
}

/// How the front of an upper garment opens.
#[derive(Debug, Clone)]
pub enum Front {
    /// Closed.
    Closed,
    /// A placket: a slit down from the neckline.
    Placket {
        /// How far it opens below the neckline (m), 60–180 mm.
        length: f64,
        /// Half its width (m), 9–20 mm; wider where the triangles could not show it.
        half_width: f64,
    },
    /// Open down to the hem, as a jacket or an unbuttoned shirt.
    Open {
        /// Half the distance of the edges at the neck (m), 6–20 mm.
        gap: f64,
        /// How much farther apart they are per metre down (m/m), 0–0.12.
        widening: f64,
    },
}
