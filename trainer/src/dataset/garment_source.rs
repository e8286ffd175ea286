//! Where the garments of a run come from: files of a folder, or the generator.

use super::error::DatasetError;
use crate::config::GarmentSourceConfig;
use clothcombo_data::asset::{Body, Category, Garment};
use clothcombo_data::folders::{ListedGarment, list_garment_folder};
use clothcombo_data::generate::GarmentGenerator;

/// A garment that can be read or made at any time, always the same.
pub enum GarmentSource {
    /// A mesh file.
    File(ListedGarment),
    /// A design of the generator.
    Generated {
        /// Its category.
        category: Category,
        /// Its seed.
        seed: u64,
        /// About how many vertices it has.
        vertices: usize,
    },
}

impl GarmentSource {
    /// All garments of `sources`, in order; no mesh is read yet.
    ///
    /// # Errors
    /// [`DatasetError`] naming the folder or manifest entry.
    pub fn list(sources: &[GarmentSourceConfig]) -> Result<Vec<Self>, DatasetError> {
        let mut all = Vec::new();
        for (source_index, source) in sources.iter().enumerate() {
            let mut own = Vec::new();
            if let Some(folder) = &source.folder {
                let listed = list_garment_folder(folder).map_err(DatasetError::data)?;
                own.extend(listed.into_iter().map(GarmentSource::File));
            }
            if let Some(generate) = &source.generate {
                own.extend((0..generate.count).map(|i| GarmentSource::Generated {
                    category: generate.categories[i % generate.categories.len()],
                    seed: generate.seed.wrapping_add(i as u64),
                    vertices: generate.vertices,
                }));
            }
            if !source.only.is_empty() {
                let names: Vec<String> = own.iter().map(Self::name).collect();
                if let Some(name) = source.only.iter().find(|wanted| !names.contains(wanted)) {
                    return Err(DatasetError::new(
                        format!(
                            "data.garments[{source_index}].only names {name:?}, which is no garment of this source"
                        ),
                        format!("the garments are: {}", names.join(", ")),
                    ));
                }
                own.retain(|origin| source.only.contains(&origin.name()));
            }
            all.append(&mut own);
        }
        Ok(all)
    }

    /// How many vertices it has; of a generated garment, which is not made for this, how many were asked for.
    ///
    /// # Errors
    /// [`DatasetError`] naming the file and line.
    pub fn vertices(&self) -> Result<usize, DatasetError> {
        match self {
            Self::File(listed) => Ok(listed.vertex_count().map_err(DatasetError::data)?),
            Self::Generated { vertices, .. } => Ok(*vertices),
        }
    }

    /// Name of the garment, unique within a source.
    pub fn name(&self) -> String {
        match self {
            Self::File(listed) => listed.name.clone(),
            Self::Generated { category, seed, .. } => GarmentGenerator::name(*category, *seed),
        }
    }
}

/// Reads and makes garments for one body.
pub struct GarmentLoader<'a> {
    body: &'a Body,
    generator: Option<GarmentGenerator<'a>>,
}

impl<'a> GarmentLoader<'a> {
    /// Ready for `sources`; the body is measured only if one of them is generated.
    ///
    /// # Errors
    /// [`DatasetError`] when no garment can be generated for the body.
    pub fn new(body: &'a Body, sources: &[GarmentSource]) -> Result<Self, DatasetError> {
        let generates = sources.iter().any(|o| matches!(o, GarmentSource::Generated { .. }));
        let generator = generates.then(|| GarmentGenerator::new(body)).transpose();
        Ok(Self { body, generator: generator.map_err(DatasetError::data)? })
    }

    /// Reads or makes one of those garments.
    ///
    /// # Errors
    /// [`DatasetError`] naming the file and line, or the design that failed.
    pub fn load(&self, origin: &GarmentSource) -> Result<Garment, DatasetError> {
        match origin {
            GarmentSource::File(listed) => listed.load(self.body).map_err(DatasetError::data),
            GarmentSource::Generated { category, seed, vertices } => {
                let generator = self.generator.as_ref().expect("made for sources with generated garments");
                generator.generate(*category, *seed, *vertices).map_err(DatasetError::data)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(rest: &str) -> GarmentSourceConfig {
        toml::from_str(&format!("generate = {{ count = 6, seed = 4 }}\n{rest}")).unwrap()
    }

    #[test]
    fn only_the_named_garments_of_a_source_are_listed() {
        let names = |sources: &[GarmentSourceConfig]| {
            GarmentSource::list(sources).map(|all| all.iter().map(GarmentSource::name).collect::<Vec<_>>())
        };
        let all = names(&[source("")]).unwrap();
        assert_eq!(all.len(), 6);
        let wanted = format!("only = [{:?}, {:?}]", all[4], all[1]);
        let some = names(&[source(&wanted), source("")]).unwrap();
        assert_eq!(some[..2], [all[1].clone(), all[4].clone()], "in the order of the source");
        assert_eq!(some[2..], all, "other sources are whole");

        let error = GarmentSource::list(&[source(""), source("only = [\"cape\"]")]).err().unwrap();
        assert!(error.to_string().contains("data.garments[1].only names \"cape\""), "{error}");
    }
}
