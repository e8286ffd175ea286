//! A garment as it was given, and as the networks see it: which file or name, what was repaired, whose vertex is whose.

use crate::config::Config;
use crate::dataset::{DatasetError, GarmentLoader, GarmentSource};
use crate::score::misplaced;
use clothcombo_data::asset::{Body, Category, Garment, GarmentMaterial};
use clothcombo_data::fit::{
    FitError, FitReport, FitSettings, PlacementCheck, fit, in_file_order, needs_repair, stray_pieces,
};
use clothcombo_data::folders::list_garment_folder;
use clothcombo_data::format::folder::has_extension;
use clothcombo_data::format::obj::texture_of_triangles;
use clothcombo_data::format::{PolygonMesh, load_mesh};
use clothcombo_data::mesh::{Attachment, MeshMeasures, thickness};
use clothcombo_physics::Surface;
use clothcombo_physics::mesh::{Topology, TriMesh};
use miette::{Report, miette};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A garment ready to be prepared for the networks.
#[derive(Clone, Debug)]
pub struct GivenGarment {
    /// At rest on the zero body.
    pub garment: Garment,
    /// The mesh as it was given: what an output file repeats.
    pub given: PolygonMesh,
    /// Where it was read from, if it was.
    pub path: Option<PathBuf>,
    /// What fitting assumed and repaired, if it was not on the body already.
    pub fit: Option<FitReport>,
    /// For every given vertex the place on `garment` that it follows.
    follows: Vec<Attachment>,
}

impl GivenGarment {
    /// A garment that already lies on the zero body.
    pub fn new(garment: Garment) -> Self {
        let mut given = PolygonMesh::with_positions(garment.rest.positions().to_vec());
        garment.rest.faces().iter().for_each(|f| given.push(f));
        let follows = (0..garment.rest.vertex_count() as u32).map(Attachment::to_vertex).collect();
        Self { garment, given, path: None, fit: None, follows }
    }

    /// Reads a mesh file. Where it does not lie on the zero body of `body` as it stands, has defects, open seams or thickness, or
    /// where `hints` say anything, it is fitted ([`clothcombo_data::fit`]); `always_fit` decides that beforehand.
    ///
    /// # Errors
    /// Naming the file, when it is no mesh, or no garment of this body.
    pub fn read(
        path: &Path,
        body: &Body,
        always_fit: Option<bool>,
        hints: &FitSettings,
    ) -> Result<Self, Report> {
        GarmentPlacement { body, always_fit, hints, check: &OnceLock::new() }.read(path)
    }

    /// Says what it is made of: constants of `material` come before those of its folder.
    pub fn add_material(&mut self, material: GarmentMaterial) {
        self.garment.material = material.or(self.garment.material);
    }

    /// The OBJ file it was read from, if it was one.
    pub fn obj_path(&self) -> Option<&Path> {
        self.path.as_deref().filter(|path| has_extension(path, "obj"))
    }

    /// Texture coordinates (u to the right, v upwards) of the corners of the garment's faces `[F, 3, 2]`: those of the OBJ file
    /// it was read from, if that has some and its vertices and faces are still the garment's.
    pub fn texture(&self) -> Option<Vec<[[f32; 2]; 3]>> {
        let path = self.obj_path()?;
        let vertex_of = |follows: &Attachment| {
            (*follows == Attachment::to_vertex(follows.corners[0])).then_some(follows.corners[0])
        };
        let vertices: Vec<u32> = self.follows.iter().map(vertex_of).collect::<Option<_>>()?;
        texture_of_triangles(&std::fs::read(path).ok()?, &vertices, self.garment.rest.faces())
    }

    /// Positions of the garment's vertices as positions of the given ones, in their order.
    pub fn in_given_order(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        in_file_order(&self.follows, positions, self.garment.rest.faces())
    }
}

/// How the mesh of a garment is brought to a body.
#[derive(Clone, Copy)]
struct GarmentPlacement<'a> {
    body: &'a Body,
    /// Whether it is fitted, where that is decided beforehand.
    always_fit: Option<bool>,
    hints: &'a FitSettings,
    /// Made where it is needed first.
    check: &'a OnceLock<Result<PlacementCheck, FitError>>,
}

impl GarmentPlacement<'_> {
    /// Refuses hints about a garment `name` that is taken as it is.
    fn check_hints(&self, name: &str) -> Result<(), Report> {
        match self.always_fit == Some(false) && *self.hints != FitSettings::default() {
            true => Err(miette!(
                help = "leave --fit never out",
                "{name}: --fit never takes garments as they are, so that nothing can be said about their files"
            )),
            false => Ok(()),
        }
    }

    /// The garment of a mesh file.
    fn read(self, path: &Path) -> Result<GivenGarment, Report> {
        let source = self.place(load_mesh(path).map_err(DatasetError::data)?, path)?;
        Ok(GivenGarment { path: Some(path.into()), ..source })
    }

    /// The garment of a mesh; `path` says in errors where it comes from.
    fn place(self, given: PolygonMesh, path: &Path) -> Result<GivenGarment, Report> {
        let Self { body, always_fit, hints, .. } = self;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let always_fit = always_fit.or((*hints != FitSettings::default()).then_some(true));
        let placed = match always_fit {
            Some(true) => None,
            Some(false) => Some(given.to_tri_mesh(path).map_err(DatasetError::data)?),
            None => {
                let lies =
                    |mesh: &TriMesh| has_no_defects(mesh) && !needs_repair(mesh) && self.is_on_body(mesh);
                given.to_tri_mesh(path).ok().filter(lies)
            }
        };
        if let Some(rest) = placed {
            check_place(path, &rest, body)?;
            let category = Category::guess(&rest, body);
            let holding = Garment::needs_holding(&rest, body);
            let garment = Garment { name, holding, ..Garment::new(category, rest) };
            return Ok(GivenGarment { given, ..GivenGarment::new(garment) });
        }
        let fitted = fit(&given, body, hints).map_err(|reason| {
            miette!(
                help = "hints about a file are those of `clothcombo fit --help`; `clothcombo check` lists defects",
                "{}: {reason}",
                path.display()
            )
        })?;
        let follows = fitted.follows;
        let garment = Garment { name, ..fitted.garment };
        Ok(GivenGarment { garment, given, path: None, fit: Some(fitted.report), follows })
    }

    /// Whether a mesh is one garment that fits where it lies.
    fn is_on_body(&self, mesh: &TriMesh) -> bool {
        let check = self.check.get_or_init(|| PlacementCheck::new(self.body));
        check
            .as_ref()
            .is_ok_and(|check| check.is_on_body(mesh, self.body) && check.worn_pieces(mesh, self.body) < 2)
    }
}

/// Whether every piece of a mesh that is taken as it is lies near the zero body: if not, it intersects nothing, and looks like a
/// good drape.
fn check_place(path: &Path, rest: &TriMesh, body: &Body) -> Result<(), Report> {
    let zero = body.zero_body();
    let what = misplaced(rest, &zero).or_else(|| {
        let (topology, surface) = (Topology::new(rest), Surface::from_mesh(&zero));
        // Whether limbs pass through the pieces is not asked of cloth that is taken as it is.
        let all: Vec<u32> = (0..topology.component_count as u32).collect();
        stray_pieces(rest.positions(), &topology, &surface, &all).first().map(ToString::to_string)
    });
    what.map_or(Ok(()), |what| {
        Err(miette!(
            help = "leave out --fit never: unit, axes and place are then found",
            "{}: {what}",
            path.display()
        ))
    })
}

/// Whether every edge, face and vertex of a mesh is as it should be.
fn has_no_defects(mesh: &TriMesh) -> bool {
    MeshMeasures::new(mesh, &Topology::new(mesh)).defects.counts().is_empty()
}

/// Finds garments by name: those of the given folders and those a model was trained on.
pub struct GarmentCatalog {
    names: Vec<String>,
    sources: HashMap<String, GarmentSource>,
    /// Of the one body that garments are asked for.
    placement: OnceLock<Result<PlacementCheck, FitError>>,
}

impl GarmentCatalog {
    /// `folders` first, then what `config` names; of two garments of one name the first counts. What the configuration names
    /// but is not there is left out: a model may be used without the garments it was trained on.
    ///
    /// # Errors
    /// When one of `folders` cannot be listed.
    pub fn new(folders: &[PathBuf], config: &Config) -> Result<Self, DatasetError> {
        let mut catalog = Self { names: Vec::new(), sources: HashMap::new(), placement: OnceLock::new() };
        for folder in folders {
            let listed = list_garment_folder(folder).map_err(DatasetError::data)?;
            catalog.extend(listed.into_iter().map(GarmentSource::File));
        }
        for source in &config.data.garments {
            if let Ok(sources) = GarmentSource::list(std::slice::from_ref(source)) {
                catalog.extend(sources);
            }
        }
        Ok(catalog)
    }

    fn extend(&mut self, sources: impl IntoIterator<Item = GarmentSource>) {
        for origin in sources {
            let name = origin.name();
            if !self.sources.contains_key(&name) {
                self.names.push(name.clone());
                self.sources.insert(name, origin);
            }
        }
    }

    /// All names, in order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The garment of a mesh in memory, which is treated as a file of that `name` is.
    ///
    /// # Errors
    /// Naming it, when it is no garment of this body.
    pub fn place(
        &self,
        name: &str,
        mesh: PolygonMesh,
        body: &Body,
        always_fit: Option<bool>,
        hints: &FitSettings,
    ) -> Result<GivenGarment, Report> {
        let placement = GarmentPlacement { body, always_fit, hints, check: &self.placement };
        placement.check_hints(name)?;
        let mut source = placement.place(mesh, Path::new(name))?;
        source.garment.name = name.to_owned();
        Ok(source)
    }

    /// The garment of a file or, where there is no such file, of that name. A named one from a file is fitted like any other file
    /// where it does not lie on this body, it may have been made for another one, or where `hints` say where it belongs
    /// ([`FitSettings::is_placed`]). Other hints are about how files are written: a named garment that lies on the body needs
    /// none.
    ///
    /// # Errors
    /// Naming the file or the unknown name.
    pub fn find(
        &self,
        name: &str,
        body: &Body,
        always_fit: Option<bool>,
        hints: &FitSettings,
    ) -> Result<GivenGarment, Report> {
        let placement = GarmentPlacement { body, always_fit, hints, check: &self.placement };
        placement.check_hints(name)?;
        let path = Path::new(name);
        // A word without a dot or a slash is a name, not a file that happens to be missing.
        let is_path = path.is_file()
            || name.contains('/')
            || (path.extension().is_some() && !self.sources.contains_key(name));
        if is_path {
            return placement.read(path);
        }
        let origin = self.sources.get(name).ok_or_else(|| unknown_garment(name, &self.names))?;
        if let (GarmentSource::Generated { .. }, true) = (origin, hints.is_placed()) {
            return Err(miette!(
                help = "leave them out, or say them in a file of outfits (--outfits) for the garments that they are about",
                "{name} is made by the generator, on this body: --offset, --turn and --from-body are about files"
            ));
        }
        let loader = GarmentLoader::new(body, std::slice::from_ref(origin))?;
        let GarmentSource::File(listed) = origin else {
            return Ok(GivenGarment::new(loader.load(origin)?));
        };
        let made = loader.load(origin);
        // Then where it lies now says nothing.
        let always_fit = always_fit.or(hints.is_placed().then_some(true));
        let must_fit = always_fit.unwrap_or_else(|| {
            // A model is used with the borders that it was trained with; they are not joined anew.
            let lies = |rest: &TriMesh| {
                has_no_defects(rest)
                    && thickness(rest.positions(), rest.faces()).is_none()
                    && placement.is_on_body(rest)
            };
            !made.as_ref().is_ok_and(|garment| lies(&garment.rest))
        });
        if must_fit {
            let mut source = GarmentPlacement { always_fit: Some(true), ..placement }.read(&listed.path)?;
            source.garment.name.clone_from(&listed.name);
            source.add_material(listed.material);
            return Ok(source);
        }
        let garment = made?;
        check_place(&listed.path, &garment.rest, body)?;
        let mut source = GivenGarment::new(garment);
        // Polygons as the file has them.
        source.given = load_mesh(&listed.path).map_err(DatasetError::data)?;
        source.path = Some(listed.path.clone());
        Ok(source)
    }
}

/// Names of garments that an error lists.
const NAMES_SHOWN: usize = 12;

fn unknown_garment(name: &str, known: &[String]) -> Report {
    let (found, help) = match known.len() {
        0 => (
            "no folder of garments is known".to_owned(),
            "pass a mesh file (.obj, .ply, .stl, .gltf, .glb), or --dataset FOLDER".to_owned(),
        ),
        n => {
            let shown = known[..n.min(NAMES_SHOWN)].join(", ");
            let help = match n {
                n if n > NAMES_SHOWN => format!("for example {shown}, and {} more", n - NAMES_SHOWN),
                _ => format!("the garments are: {shown}"),
            };
            (format!("none of the {n} known garments is called that"), help)
        }
    };
    miette!(help = help, "no garment {name:?}: it is no file, and {found}")
}
