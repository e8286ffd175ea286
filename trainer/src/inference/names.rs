//! Names of garments as names of files.

use std::collections::HashSet;

/// Names that are different, also where capitals do not count.
#[derive(Default)]
pub struct UniqueNames(HashSet<String>);

impl UniqueNames {
    /// `name` as a file name beside all that were taken before, and beside that of the body.
    pub fn take(&mut self, name: &str) -> String {
        self.0.insert("body".to_owned());
        let plain = |c: char| if c.is_alphanumeric() || "-_+.".contains(c) { c } else { '_' };
        let name: String = name.chars().map(plain).collect();
        let name = if name.trim_matches('.').is_empty() { "garment".to_owned() } else { name };
        let numbered = (2..).map(|n| format!("{name}-{n}"));
        // Some file systems do not tell capitals apart.
        let is_free = |n: &String| !self.0.contains(&n.to_lowercase());
        let free = std::iter::once(name.clone()).chain(numbered).find(is_free).unwrap_or(name);
        self.0.insert(free.to_lowercase());
        free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_can_be_files() {
        let mut names = UniqueNames::default();
        let taken = ["tee", "Tee", "body", "a/b c", "..", "tee", "Hemd_ä"].map(|n| names.take(n));
        assert_eq!(taken, ["tee", "Tee-2", "body-2", "a_b_c", "garment", "tee-3", "Hemd_ä"]);
    }
}
