//! Phenotypes and the sparse vertex targets they mix.
//!
//! A target's file name lists the anchors it belongs to, for example `universal-female-young-minmuscle-averageweight`; its
//! weight is the product of the piecewise-linear weights of these anchors.

use super::wheel::{BASE_VERTEX_COUNT, MOST_UNPACKED_BYTES, Wheel};
use clothcombo_data::format::FileError;
use flate2::read::GzDecoder;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use std::collections::HashMap;
use std::io::Read;

/// Position of a person between the anchors; all but the race weights in `[0, 1]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Phenotype {
    /// 0 male … 1 female.
    pub gender: f64,
    /// 1/3 child, 2/3 young, 1 old.
    pub age: f64,
    /// Muscle.
    pub muscle: f64,
    /// Weight.
    pub weight: f64,
    /// Height; 0.5 is 1.9 m, an average adult is about 0.37.
    pub height: f64,
    /// 0 ideal … 1 uncommon.
    pub proportions: f64,
    /// Breast size.
    pub cup_size: f64,
    /// Breast firmness.
    pub firmness: f64,
    /// African, Asian, Caucasian; only the ratios count.
    pub race: [f64; 3],
}

impl Phenotype {
    /// A random adult: a man or a woman, heights normal about the real mean.
    pub fn random_adult(rng: &mut impl Rng) -> Self {
        let mut normal = |mean: f64, deviation: f64, low: f64, high: f64| {
            // Normal::new only fails for a deviation that is not finite.
            Normal::new(mean, deviation).map_or(mean, |n| n.sample(rng)).clamp(low, high)
        };
        let (muscle, weight) = (normal(0.5, 0.2, 0.0, 1.0), normal(0.5, 0.22, 0.0, 1.0));
        let (height, cup_size) = (normal(0.37, 0.065, 0.05, 0.95), normal(0.5, 0.2, 0.0, 1.0));
        Self {
            gender: f64::from(rng.random_range(0..2u8)),
            age: rng.random_range(0.5..1.0),
            muscle,
            weight,
            height,
            proportions: rng.random_range(0.2..1.0),
            cup_size,
            firmness: rng.random_range(0.2..0.8),
            race: std::array::from_fn(|_| rng.random_range(0.01..1.01)),
        }
    }

    /// (anchor name, weight) pairs of one axis, zero weights left out.
    fn anchors(&self, axis: PhenotypeAxis) -> Vec<(&'static str, f64)> {
        const THIRDS: [f64; 3] = [1.0 / 3.0, 2.0 / 3.0, 1.0];
        const HALVES: [f64; 3] = [0.0, 0.5, 1.0];
        const ENDS: [f64; 2] = [0.0, 1.0];
        let (value, places, names): (f64, &[f64], &[&str]) = match axis {
            PhenotypeAxis::Race => {
                let sum: f64 = self.race.iter().sum();
                let weights = self.race.map(|w| w / sum);
                return ["african", "asian", "caucasian"]
                    .into_iter()
                    .zip(weights)
                    .filter(|(_, w)| *w > 0.0)
                    .collect();
            }
            PhenotypeAxis::Gender => (self.gender, &ENDS, &["male", "female"]),
            PhenotypeAxis::Age => (self.age, &THIRDS, &["child", "young", "old"]),
            PhenotypeAxis::Muscle => (self.muscle, &HALVES, &["minmuscle", "averagemuscle", "maxmuscle"]),
            PhenotypeAxis::Weight => (self.weight, &HALVES, &["minweight", "averageweight", "maxweight"]),
            PhenotypeAxis::Height => (self.height, &ENDS, &["minheight", "maxheight"]),
            PhenotypeAxis::Proportions => {
                (self.proportions, &ENDS, &["idealproportions", "uncommonproportions"])
            }
            PhenotypeAxis::CupSize => (self.cup_size, &HALVES, &["mincup", "averagecup", "maxcup"]),
            PhenotypeAxis::Firmness => {
                (self.firmness, &HALVES, &["minfirmness", "averagefirmness", "maxfirmness"])
            }
        };
        let value = value.clamp(places[0], places[places.len() - 1]);
        let upper = places.iter().position(|p| *p >= value).unwrap_or(places.len() - 1).max(1);
        let t = (value - places[upper - 1]) / (places[upper] - places[upper - 1]);
        [(names[upper - 1], 1.0 - t), (names[upper], t)].into_iter().filter(|(_, w)| *w > 0.0).collect()
    }
}

#[derive(Clone, Copy)]
enum PhenotypeAxis {
    Race,
    Gender,
    Age,
    Muscle,
    Weight,
    Height,
    Proportions,
    CupSize,
    Firmness,
}

/// The families of targets: file-name prefix and the axes its parts run over.
const TARGET_FAMILIES: [(&str, &[PhenotypeAxis]); 5] = {
    use PhenotypeAxis::{Age, CupSize, Firmness, Gender, Height, Muscle, Proportions, Race, Weight};
    [
        ("macrodetails/universal-", &[Gender, Age, Muscle, Weight]),
        ("macrodetails/", &[Race, Gender, Age]),
        ("macrodetails/height/", &[Gender, Age, Muscle, Weight, Height]),
        ("macrodetails/proportions/", &[Gender, Age, Muscle, Weight, Proportions]),
        ("breast/", &[Gender, Age, Muscle, Weight, CupSize, Firmness]),
    ]
};

/// Sparse displacements (m).
type Target = Vec<(u32, [f32; 3])>;

/// All phenotype targets of the wheel.
pub struct Targets {
    by_name: HashMap<String, Target>,
}

impl Targets {
    /// Reads and parses the targets (about 600 gzipped text files).
    pub fn read(wheel: &mut Wheel) -> Result<Self, FileError> {
        let mut compressed = Vec::new();
        for folder in ["targets/macrodetails/", "targets/breast/"] {
            for member in wheel.members(folder).into_iter().filter(|m| m.ends_with(".target.gz")) {
                compressed.push((wheel.read(&member)?, member));
            }
        }
        let parsed: Result<Vec<(String, Target)>, (String, String)> = compressed
            .into_par_iter()
            .map(|(bytes, member)| match parse_target(&bytes) {
                Ok(target) => {
                    let name = member.trim_start_matches("targets/").trim_end_matches(".target.gz");
                    Ok((name.to_string(), target))
                }
                Err(message) => Err((member, message)),
            })
            .collect();
        let by_name =
            parsed.map_err(|(member, message)| wheel.error(&member, message))?.into_iter().collect();
        Ok(Self { by_name })
    }

    /// Number of targets.
    pub fn len(&self) -> usize {
        self.by_name.len()
    }

    /// The base mesh moved by the targets of one person. Combinations without a file displace nothing.
    pub fn apply(&self, base: &[[f64; 3]], person: &Phenotype) -> Vec<[f64; 3]> {
        let mut positions = base.to_vec();
        for (prefix, axes) in TARGET_FAMILIES {
            // Breast targets exist for women only.
            if prefix == "breast/" && person.gender <= 0.0 {
                continue;
            }
            let mut combinations = vec![(prefix.to_string(), 1.0)];
            for (i, axis) in axes.iter().enumerate() {
                let anchors = person.anchors(*axis);
                let dash = if i == 0 { "" } else { "-" };
                combinations = combinations
                    .iter()
                    .flat_map(|(name, w)| {
                        anchors.iter().map(move |(part, x)| (format!("{name}{dash}{part}"), w * x))
                    })
                    .collect();
            }
            for (name, weight) in combinations {
                for (vertex, offset) in self.by_name.get(&name).into_iter().flatten() {
                    let p = &mut positions[*vertex as usize];
                    for a in 0..3 {
                        p[a] += weight * f64::from(offset[a]);
                    }
                }
            }
        }
        positions
    }
}

/// Lines `index dx dy dz` in decimetres; comments and blank lines are allowed, an empty file too.
fn parse_target(bytes: &[u8]) -> Result<Target, String> {
    let mut text = String::new();
    GzDecoder::new(bytes)
        .take(MOST_UNPACKED_BYTES + 1)
        .read_to_string(&mut text)
        .map_err(|e| e.to_string())?;
    if text.len() as u64 > MOST_UNPACKED_BYTES {
        return Err(format!("it unpacks to more than {} MiB", MOST_UNPACKED_BYTES >> 20));
    }
    let mut target = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong = || format!("line {}: expected 'index dx dy dz', found '{line}'", number + 1);
        let mut words = line.split_ascii_whitespace();
        let index: u32 = words.next().and_then(|w| w.parse().ok()).ok_or_else(wrong)?;
        if index as usize >= BASE_VERTEX_COUNT {
            return Err(format!("line {}: vertex {index} of {BASE_VERTEX_COUNT}", number + 1));
        }
        let mut offset = [0.0f32; 3];
        for x in &mut offset {
            let decimetres: f64 = words
                .next()
                .and_then(|w| w.parse().ok())
                .filter(|x: &f64| x.is_finite())
                .ok_or_else(wrong)?;
            *x = (0.1 * decimetres) as f32;
        }
        target.push((index, offset));
    }
    Ok(target)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The middle of everything.
    fn average() -> Phenotype {
        Phenotype {
            gender: 0.5,
            age: 2.0 / 3.0,
            muscle: 0.5,
            weight: 0.5,
            height: 0.37,
            proportions: 0.5,
            cup_size: 0.5,
            firmness: 0.5,
            race: [1.0; 3],
        }
    }

    #[test]
    fn anchor_weights_sum_to_one_and_interpolate() {
        let mut person = average();
        person.age = 0.5;
        person.muscle = 0.75;
        assert_eq!(person.anchors(PhenotypeAxis::Muscle), [("averagemuscle", 0.5), ("maxmuscle", 0.5)]);
        assert_eq!(average().anchors(PhenotypeAxis::Weight), [("averageweight", 1.0)]);
        for axis in [
            PhenotypeAxis::Race,
            PhenotypeAxis::Gender,
            PhenotypeAxis::Age,
            PhenotypeAxis::Height,
            PhenotypeAxis::CupSize,
        ] {
            let sum: f64 = person.anchors(axis).iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
        let [(child, a), (young, b)] = person.anchors(PhenotypeAxis::Age)[..] else { panic!() };
        assert!(child == "child" && young == "young" && (a - 0.5).abs() < 1e-12 && (b - 0.5).abs() < 1e-12);
    }

    #[test]
    fn target_lines_are_checked() {
        use flate2::{Compression, write::GzEncoder};
        use std::io::Write;
        let gz = |text: &str| {
            let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(text.as_bytes()).unwrap();
            encoder.finish().unwrap()
        };
        assert_eq!(parse_target(&gz("# c\n\n7 1 -2 .5\n")).unwrap(), [(7, [0.1, -0.2, 0.05])]);
        assert_eq!(parse_target(&gz("")).unwrap(), []);
        assert!(parse_target(&gz("7 1 nan 2\n")).unwrap_err().contains("line 1"));
        assert!(parse_target(&gz("1 0 0 0\n19158 1 1 1\n")).unwrap_err().contains("line 2: vertex 19158"));
        assert!(parse_target(b"plain text").is_err());
    }
}
