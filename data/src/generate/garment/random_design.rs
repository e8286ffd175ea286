//! Random designs of each category.

use super::design::{
    FlareDesign, Front, GarmentDesign, Neckline, PleatDesign, SkirtDesign, SleeveDesign, TrousersDesign,
    UpperDesign,
};
use crate::asset::Category;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Random numbers by range.
struct Chance<'a>(&'a mut ChaCha8Rng);

impl Chance<'_> {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// More often near `low` for a `power` above 1.
    fn skewed(&mut self, low: f64, high: f64, power: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>().powf(power)
    }

    fn happens(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }

    fn one_of<const N: usize>(&mut self, ranges: [[f64; 2]; N]) -> f64 {
        let [low, high] = ranges[self.0.random_range(0..N)];
        self.between(low, high)
    }
}

impl GarmentDesign {
    /// A random design of `category`.
    pub fn random(category: Category, rng: &mut ChaCha8Rng) -> Self {
        let chance = &mut Chance(rng);
        match category {
            Category::Skirt => Self::Skirt(skirt(chance)),
            Category::Trousers => Self::Trousers(trousers(chance)),
            _ => Self::Upper(upper(category, chance)),
        }
    }
}

fn flare(chance: &mut Chance, most: f64, pleated: f64) -> FlareDesign {
    let flare = chance.skewed(0.0, most, 2.0);
    let pleats = chance.happens(pleated).then(|| PleatDesign {
        count: chance.between(6.0, 28.99) as u32,
        depth: chance.between(0.06, 0.22),
        formed: chance.between(0.15, 1.0),
        phase: chance.between(0.0, TAU),
    });
    FlareDesign { flare, pleats }
}

fn skirt(chance: &mut Chance) -> SkirtDesign {
    SkirtDesign {
        rise: chance.between(0.0, 1.0),
        length: chance.skewed(1.1, 1.92, 1.3),
        ease: chance.between(0.006, 0.016),
        hang: chance.between(0.6, 1.0),
        skirt: flare(chance, 0.55, 0.55),
        rim_tilt: chance.between(-0.08, 0.08),
        hem_tilt: chance.between(-0.04, 0.04),
    }
}

fn trousers(chance: &mut Chance) -> TrousersDesign {
    // Shorts, to the knee, long.
    let length = chance.one_of([[1.08, 1.3], [1.35, 1.65], [1.87, 1.97]]);
    let cuffed = length > 1.3 && chance.happens(0.25);
    TrousersDesign {
        rise: chance.between(0.0, 1.0),
        length,
        drop: chance.between(0.012, 0.035),
        ease: chance.between(0.006, 0.018),
        leg_ease: chance.between(0.007, 0.024),
        hang: chance.between(0.0, 1.0),
        flare: if cuffed { chance.between(-0.01, 0.01) } else { chance.between(-0.01, 0.07) },
        cuff: if cuffed { chance.between(0.5, 1.0) } else { 0.0 },
        rim_tilt: chance.between(-0.08, 0.08),
    }
}

fn upper(category: Category, chance: &mut Chance) -> UpperDesign {
    let length = match category {
        Category::Dress => chance.skewed(1.1, 1.92, 1.3),
        Category::Top => chance.between(-0.15, 0.95),
        Category::TShirt => chance.between(0.1, 1.05),
        _ => chance.between(0.4, 1.15),
    };
    let has_sleeves = match category {
        Category::TShirt | Category::OpenShirt => true,
        Category::Dress => chance.happens(0.45),
        _ => false,
    };
    let looseness = chance.between(0.0, 1.0);
    let hang = if category == Category::Dress { chance.between(0.6, 1.0) } else { looseness };
    let skirt = match category {
        Category::Dress => flare(chance, 0.5, 0.5),
        _ => flare(chance, 0.12, 0.0),
    };
    let neckline = if !has_sleeves && chance.happens(0.25) {
        Neckline::Strapless { drop: chance.between(0.025, 0.05), tilt: chance.between(-0.06, 0.06) }
    } else {
        Neckline::Neck {
            width: chance.skewed(0.024, if has_sleeves { 0.055 } else { 0.075 }, 1.4),
            depth: chance.skewed(0.005, if category == Category::TShirt { 0.07 } else { 0.11 }, 1.4),
            depth_back: chance.skewed(0.0, if has_sleeves { 0.015 } else { 0.05 }, 1.4),
            power: [1.15, 2.0, 2.0, 3.0][chance.between(0.0, 3.99) as usize],
            armhole: chance.between(0.80, 0.97),
            armhole_drop: chance.between(0.015, 0.035),
        }
    };
    let sleeves = has_sleeves.then(|| {
        // Short, to the elbow and below, long.
        let length = chance.one_of([[0.20, 0.42], [0.45, 0.75], [0.85, 0.97]]);
        let cuffed = length > 0.45 && chance.happens(0.35);
        SleeveDesign {
            length,
            ease: chance.between(0.0, 0.006),
            hang: chance.between(0.0, 0.8),
            flare: if cuffed { chance.between(0.0, 0.02) } else { chance.between(-0.004, 0.035) } * length,
            armhole: chance.between(0.0, 0.012),
            tilt: if cuffed { 0.0 } else { chance.between(-0.15, 0.15) },
            cuff: if cuffed { chance.between(0.5, 1.0) } else { 0.0 },
        }
    });
    let placket = match category {
        Category::TShirt => 0.25,
        Category::Dress | Category::Top => 0.15,
        _ => 0.0,
    };
    let front = if category == Category::OpenShirt {
        Front::Open { gap: chance.between(0.006, 0.02), widening: chance.between(0.0, 0.12) }
    } else if matches!(neckline, Neckline::Neck { .. }) && chance.happens(placket) {
        Front::Placket { length: chance.between(0.06, 0.18), half_width: chance.between(0.009, 0.02) }
    } else {
        Front::Closed
    };
    let tail = if category == Category::OpenShirt { 0.10 } else { 0.05 };
    let hem_tilt = chance.between(-tail, tail);
    UpperDesign { category, length, looseness, hang, skirt, hem_tilt, neckline, sleeves, front }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn random_designs_have_every_kind() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut pleats, mut plackets, mut cuffs, mut strapless) = (0, 0, 0, 0);
        for i in 0..600 {
            let category = Category::ALL[i % 6];
            let design = GarmentDesign::random(category, &mut rng);
            assert_eq!(design.category(), category);
            let skirt = match &design {
                GarmentDesign::Skirt(s) => &s.skirt,
                GarmentDesign::Upper(u) => &u.skirt,
                GarmentDesign::Trousers(t) => {
                    cuffs += usize::from(t.cuff > 0.0);
                    continue;
                }
            };
            pleats += usize::from(skirt.pleats.is_some());
            if let GarmentDesign::Upper(u) = &design {
                plackets += usize::from(matches!(u.front, Front::Placket { .. }));
                strapless += usize::from(matches!(u.neckline, Neckline::Strapless { .. }));
                cuffs += usize::from(u.sleeves.as_ref().is_some_and(|s| s.cuff > 0.0));
            }
        }
        for (kind, count) in
            [("pleats", pleats), ("plackets", plackets), ("cuffs", cuffs), ("strapless", strapless)]
        {
            assert!(count > 15, "{kind}: {count} of 600");
        }
    }
}
