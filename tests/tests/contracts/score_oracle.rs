//! All eight energies against `scripts/score_oracle.py`, an independent program in numpy: its values for the meshes of
//! `fixtures/score` are kept beside them (`fixtures/score/make.py` makes both).

use clothcombo_data::format::obj;
use clothcombo_physics::energy::{
    EnergySettings, GarmentEnergies, SceneEnergy, SceneGarment, SceneLayers, Term, TermMap,
};
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::query::Surface;
use clothcombo_trainer::score::{NamedMesh, SceneMeshes, ScoreDistance, score_meshes};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the contract asks for is 1e-6.
const TOLERANCE: f64 = 1e-9;

/// A folder of meshes with the oracle's values.
struct Golden {
    folder: PathBuf,
    oracle: Value,
}

impl Golden {
    fn open(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/score").join(name);
        let text = std::fs::read_to_string(folder.join("oracle.json")).unwrap();
        Self { folder, oracle: serde_json::from_str(&text).unwrap() }
    }

    fn names(&self) -> Vec<&str> {
        let garments = self.oracle["garments"].as_array().unwrap();
        garments.iter().map(|g| g["name"].as_str().unwrap()).collect()
    }

    fn files(&self, kind: &str) -> Vec<PathBuf> {
        self.names().iter().map(|name| self.folder.join(kind).join(format!("{name}.obj"))).collect()
    }

    fn meshes(&self, kind: &str) -> Vec<TriMesh> {
        self.files(kind).iter().map(|path| obj::load(path).unwrap()).collect()
    }
}

fn assert_close(found: f64, oracle: &Value, what: &str) {
    let oracle = oracle.as_f64().unwrap_or_else(|| panic!("the oracle has no {what}"));
    let scale = found.abs().max(oracle.abs());
    assert!((found - oracle).abs() <= TOLERANCE * scale, "{what}: {found:e}, oracle {oracle:e}");
}

/// The fixtures exercise every term: those values the oracle must not have at zero.
fn assert_exercised(oracle: &Value) {
    for term in Term::ALL {
        let of = if term.is_layer_term() { &oracle["layers"] } else { &oracle["garments"] };
        let value = |entry: &Value| {
            let map = if term.is_layer_term() { entry } else { &entry["raw"] };
            map[term.name()].as_f64().unwrap()
        };
        assert!(of.as_array().unwrap().iter().any(|entry| value(entry) != 0.0), "{term} is zero everywhere");
    }
}

#[test]
fn all_eight_energies_equal_the_oracle() {
    for name in ["outfit", "hard"] {
        let golden = Golden::open(name);
        assert_exercised(&golden.oracle);
        let (rest, draped, canonical) =
            (golden.meshes("rest"), golden.meshes("draped"), golden.meshes("canonical"));
        let settings = EnergySettings::printed();
        let garments = rest.iter().map(|rest| SceneGarment {
            energies: Arc::new(
                GarmentEnergies::<f64>::new(rest, &Topology::new(rest), &settings, true).unwrap(),
            ),
            holding_reference: rest.positions().to_vec(),
            thickness_below: Vec::new(),
            pull_back: None,
            weights: TermMap::filled(1.0),
        });
        let pairs: Vec<(usize, usize)> =
            (0..rest.len()).flat_map(|i| (i + 1..rest.len()).map(move |j| (i, j))).collect();
        let layer =
            |&(inner, outer): &(usize, usize)| SceneLayers { inner, outer, weights: TermMap::filled(1.0) };
        // A vertex that no face uses has no side; the oracle leaves those of the body out, as a score does.
        let body = used_part(&obj::load(&golden.folder.join("body.obj")).unwrap());
        let scene = SceneEnergy {
            body: Arc::new(Surface::from_mesh(&body)),
            garments: garments.collect(),
            layers: pairs.iter().map(layer).collect(),
            settings,
        };
        scene.check().unwrap();
        let packed =
            |meshes: &[TriMesh]| meshes.iter().flat_map(|m| m.positions()).copied().collect::<Vec<_>>();
        let value = scene.raw(&packed(&draped), &packed(&canonical));
        for (i, garment) in value.garments.iter().enumerate() {
            for (term, value) in garment.iter().filter(|(term, _)| !term.is_layer_term()) {
                let oracle = &golden.oracle["garments"][i]["raw"][term.name()];
                assert_close(value.unwrap(), oracle, &format!("{term} of {name} {i}"));
            }
        }
        for (i, layer) in value.layers.iter().enumerate() {
            for (term, value) in layer.iter().filter(|(term, _)| term.is_layer_term()) {
                assert_close(
                    value.unwrap(),
                    &golden.oracle["layers"][i][term.name()],
                    &format!("{term} {name} {i}"),
                );
            }
        }
    }
}

#[test]
fn the_score_equals_the_oracle() {
    for name in ["outfit", "hard"] {
        let golden = Golden::open(name);
        let load = |kind| golden.files(kind).iter().map(|path| NamedMesh::load(path).unwrap()).collect();
        let body = NamedMesh::load_body(&golden.folder.join("body.obj")).unwrap();
        let meshes =
            SceneMeshes { body, rest: load("rest"), draped: load("draped"), canonical: load("canonical") };
        let score = score_meshes(meshes, ScoreDistance::NearestVertex).unwrap();
        assert_eq!(score.garments.iter().map(|g| g.name.as_str()).collect::<Vec<_>>(), golden.names());
        for (garment, oracle) in score.garments.iter().zip(golden.oracle["garments"].as_array().unwrap()) {
            for (values, kind) in [(&garment.raw, "raw"), (&garment.weighted, "weighted")] {
                assert_eq!(values.len(), 6);
                for (term, value) in values {
                    assert_close(*value, &oracle[kind][term], &format!("{kind} {term} of {}", garment.name));
                }
            }
        }
        for (layer, oracle) in score.layers.iter().zip(golden.oracle["layers"].as_array().unwrap()) {
            assert_eq!(Some(layer.inner as u64), oracle["inner"].as_u64());
            assert_eq!(Some(layer.outer as u64), oracle["outer"].as_u64());
            assert_close(layer.layer_collision, &oracle["layer_collision"], "layer_collision");
            assert_close(layer.layer_distance, &oracle["layer_distance"], "layer_distance");
        }
    }
}

fn used_part(mesh: &TriMesh) -> TriMesh {
    let mut used: Vec<u32> = mesh.faces().concat();
    used.sort_unstable();
    used.dedup();
    let positions = used.iter().map(|&v| mesh.positions()[v as usize]).collect();
    let number = |v: u32| used.binary_search(&v).unwrap() as u32;
    TriMesh::new(positions, mesh.faces().iter().map(|face| face.map(number)).collect()).unwrap()
}
