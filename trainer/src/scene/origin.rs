//! Where the garments of a run come from: files of a folder, or the generator.

use super::error::LibraryError;
use crate::config::GarmentSource;
use clothcombo_data::asset::{Body, Category, Garment};
use clothcombo_data::dataset::{ListedGarment, list_garment_folder};
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings};

/// A garment that can be read or made at any time, always the same.
pub enum Origin {
    /// A mesh file.
    File(ListedGarment),
    /// A design of the generator.
    Generated {
        /// Its category.
        category: Category,
        /// Its seed.
        seed: u64,
        /// Size and detail.
        settings: GarmentSettings,
    },
}

impl Origin {
    /// All garments of `sources`, in order; no mesh is read yet.
    ///
    /// # Errors
    /// [`LibraryError`] naming the folder or manifest entry.
    pub fn list(sources: &[GarmentSource]) -> Result<Vec<Self>, LibraryError> {
        let mut origins = Vec::new();
        for source in sources {
            if let Some(folder) = &source.folder {
                let listed = list_garment_folder(folder).map_err(LibraryError::data)?;
                origins.extend(listed.into_iter().map(Origin::File));
            }
            let Some(generate) = &source.generate else { continue };
            let settings =
                GarmentSettings { target_vertices: generate.vertices, ..GarmentSettings::default() };
            origins.extend((0..generate.count).map(|i| Origin::Generated {
                category: generate.categories[i % generate.categories.len()],
                seed: generate.seed.wrapping_add(i as u64),
                settings: settings.clone(),
            }));
        }
        Ok(origins)
    }
}

/// Reads and makes garments for one body.
pub struct Maker<'a> {
    body: &'a Body,
    generator: Option<GarmentGenerator<'a>>,
}

impl<'a> Maker<'a> {
    /// Ready for `origins`; the body is measured only if one of them is generated.
    ///
    /// # Errors
    /// [`LibraryError`] when no garment can be generated for the body.
    pub fn new(body: &'a Body, origins: &[Origin]) -> Result<Self, LibraryError> {
        let generates = origins.iter().any(|o| matches!(o, Origin::Generated { .. }));
        let generator = generates.then(|| GarmentGenerator::new(body)).transpose();
        Ok(Self { body, generator: generator.map_err(LibraryError::data)? })
    }

    /// Reads or makes one of those garments.
    ///
    /// # Errors
    /// [`LibraryError`] naming the file and line, or the design that failed.
    pub fn make(&self, origin: &Origin) -> Result<Garment, LibraryError> {
        match origin {
            Origin::File(listed) => Ok(listed.load(self.body).map_err(LibraryError::data)?.garment),
            Origin::Generated { category, seed, settings } => {
                let generator = self.generator.as_ref().expect("made for origins with generated garments");
                generator.generate(*category, *seed, settings).map_err(LibraryError::data)
            }
        }
    }
}
