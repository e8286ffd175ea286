//! Which garments are trained on, which only validate, and which are kept for the final test.

use super::error::DatasetError;
use crate::config::DataConfig;

/// Garments by what they are for; indices into the dataset, ascending.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GarmentSplit {
    /// Trained on.
    pub training: Vec<usize>,
    /// Never trained on; scored during the run.
    pub validation: Vec<usize>,
    /// Never trained on and never scored during the run.
    pub test: Vec<usize>,
}

impl GarmentSplit {
    /// Splits garments by name: those of `held_out_garments` are for the test, the others go by the hash of their name, so
    /// that a garment stays where it is when others are added or removed.
    ///
    /// # Errors
    /// [`DatasetError`] when a held-out name fits no garment or nothing is left to train on.
    pub fn new(names: &[&str], config: &DataConfig) -> Result<Self, DatasetError> {
        let held_out = &config.held_out_garments;
        if let Some(name) = held_out.iter().find(|n| !names.contains(&n.as_str())) {
            return Err(DatasetError::new(
                format!("data.held_out_garments names {name:?}, which is no garment of this run"),
                format!("the garments are: {}", names.join(", ")),
            ));
        }
        let mut split = Self { training: Vec::new(), validation: Vec::new(), test: Vec::new() };
        for (i, &name) in names.iter().enumerate() {
            let part = match purpose(name, config) {
                GarmentPurpose::Training => &mut split.training,
                GarmentPurpose::Validation => &mut split.validation,
                GarmentPurpose::Test => &mut split.test,
            };
            part.push(i);
        }
        match split.training.is_empty() {
            true => Err(DatasetError::new(
                format!("all {} garments are held out, none is left to train on", names.len()),
                "shorten data.held_out_garments",
            )),
            false => Ok(split),
        }
    }
}

/// What a garment is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GarmentPurpose {
    /// Trained on.
    Training,
    /// Never trained on; scored during the run.
    Validation,
    /// Never trained on and never scored during the run.
    Test,
}

/// What a garment of this name is for where `config` splits the data.
pub fn purpose(name: &str, config: &DataConfig) -> GarmentPurpose {
    match place(name) {
        _ if config.held_out_garments.iter().any(|n| n == name) => GarmentPurpose::Test,
        place if place >= 1.0 - config.split.test => GarmentPurpose::Test,
        place if place < config.split.validation => GarmentPurpose::Validation,
        _ => GarmentPurpose::Training,
    }
}

/// A number in [0, 1) that depends on the name alone.
pub(super) fn place(name: &str) -> f64 {
    let hash = blake3::hash(name.as_bytes());
    let first = u64::from_le_bytes(hash.as_bytes()[..8].try_into().expect("eight bytes"));
    (first >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::SplitConfig;

    fn config(validation: f64, test: f64, held_out: &[&str]) -> DataConfig {
        let mut config: DataConfig = toml::from_str("garments = []").unwrap();
        config.split = SplitConfig { validation, test };
        config.held_out_garments = held_out.iter().map(|n| n.to_string()).collect();
        config
    }

    #[test]
    fn shares_hold_and_a_garment_stays_where_it_is() {
        let names: Vec<String> = (0..2000).map(|i| format!("garment {i}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let all = GarmentSplit::new(&names, &config(0.1, 0.2, &[])).unwrap();
        assert!((150..250).contains(&all.validation.len()), "{}", all.validation.len());
        assert!((340..460).contains(&all.test.len()), "{}", all.test.len());
        assert_eq!(all.training.len() + all.validation.len() + all.test.len(), 2000);
        let half = GarmentSplit::new(&names[..1000], &config(0.1, 0.2, &[])).unwrap();
        let first_half: Vec<usize> = all.test.iter().copied().filter(|&i| i < 1000).collect();
        assert_eq!(half.test, first_half);
    }

    #[test]
    fn named_garments_are_for_the_test_and_mistakes_are_named() {
        let names = ["a", "b", "c"];
        let split = GarmentSplit::new(&names, &config(0.0, 0.0, &["b"])).unwrap();
        assert_eq!((split.training, split.test), (vec![0, 2], vec![1]));
        let unknown = GarmentSplit::new(&names, &config(0.0, 0.0, &["d"])).unwrap_err();
        assert!(unknown.to_string().contains("\"d\""));
        let none = GarmentSplit::new(&names, &config(0.0, 0.0, &names)).unwrap_err();
        assert!(none.to_string().contains("all 3 garments are held out"), "{none}");
    }
}
