//! What the data of a run consists of, by name: with it a checkpoint tells which garment, clip or body is another one now.

use super::body::with_body;
use super::garment_store::GarmentStore;
use super::poses::ClipSplit;
use clothcombo_data::asset::Body;
use clothcombo_data::cache::KeyBuilder;
use clothcombo_data::folders::list_motion_folder;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Body, garments and clips, in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DataList(Vec<Datum>);

/// One of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Datum {
    kind: DatumKind,
    name: String,
    /// What it is, in words that differ where it differs.
    is: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum DatumKind {
    Body,
    Garment,
    Clip,
}

impl DatumKind {
    /// What it is called, and the key of the configuration that says where it comes from.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Body => ("body", "data.body"),
            Self::Garment => ("garment", "data.garments"),
            Self::Clip => ("clip", "data.poses"),
        }
    }
}

/// A part of the data that is not what it was.
#[derive(Clone, Debug, PartialEq)]
pub struct DataChange {
    /// The key of the configuration it comes from.
    pub key: &'static str,
    /// What changed, in words.
    pub text: String,
}

/// Digits of a digest that are shown and compared.
const DIGITS: usize = 12;

impl DataList {
    /// The list of a run's data; the clips in the folder `motions`, split into `clips`, are read once more, as files.
    pub(super) fn of(
        body: &Body,
        garments: &GarmentStore,
        motions: Option<&Path>,
        clips: &ClipSplit,
    ) -> Self {
        let digest = with_body(KeyBuilder::new("body"), body).finish();
        let mut all = vec![Datum {
            kind: DatumKind::Body,
            name: body.name.clone(),
            is: format!("{} vertices, {}", body.vertex_count(), short(&digest.to_string())),
        }];
        all.extend((0..garments.len()).map(|index| {
            let garment = garments.info(index);
            let held = if garment.holding { "held" } else { "not held" };
            let (category, vertices, mesh) = (garment.category, garment.vertices, garment.mesh.to_string());
            Datum {
                kind: DatumKind::Garment,
                name: garment.name.clone(),
                is: format!("{category}, {held}, {vertices} vertices, {}", short(&mesh)),
            }
        }));
        let files = motions.and_then(|folder| list_motion_folder(folder).ok()).unwrap_or_default();
        all.extend(files.par_iter().map(|file| clip(file, clips)).collect::<Vec<_>>());
        Self(all)
    }

    /// What is not in this list as it is in `earlier`.
    pub fn changes_since(&self, earlier: &Self) -> Vec<DataChange> {
        let [now, before] = [self, earlier].map(Self::by_name);
        let names: BTreeSet<_> = now.keys().chain(before.keys()).copied().collect();
        let differs = names.into_iter().filter(|name| now.get(name) != before.get(name));
        let change = |(kind, name): (DatumKind, &str)| {
            let [is, was] = [&now, &before]
                .map(|list| list.get(&(kind, name)).map_or("missing".to_owned(), |all| all.join(" and ")));
            let (what, key) = kind.words();
            DataChange { key, text: format!("{what} {name}: {is} now; {was} in the checkpoint") }
        };
        differs.map(change).collect()
    }

    /// Names are unique within a source only.
    fn by_name(&self) -> BTreeMap<(DatumKind, &str), Vec<&str>> {
        let mut all: BTreeMap<_, Vec<&str>> = BTreeMap::new();
        for datum in &self.0 {
            all.entry((datum.kind, datum.name.as_str())).or_default().push(&datum.is);
        }
        all
    }
}

fn clip(file: &Path, clips: &ClipSplit) -> Datum {
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let purpose = match () {
        () if clips.validation.contains(&name) => "for validation",
        () if clips.test.contains(&name) => "for the test",
        () => "for training",
    };
    let digest =
        fs::read(file).map_or_else(|e| e.to_string(), |bytes| blake3::hash(&bytes).to_hex().to_string());
    Datum { kind: DatumKind::Clip, name, is: format!("{purpose}, {}", short(&digest)) }
}

fn short(digest: &str) -> &str {
    digest.get(..DIGITS).unwrap_or(digest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_told_by_name_with_both_values() {
        let list = |all: &[(DatumKind, &str, &str)]| {
            DataList(
                all.iter()
                    .map(|(kind, name, is)| Datum { kind: *kind, name: (*name).into(), is: (*is).into() })
                    .collect(),
            )
        };
        let before = list(&[
            (DatumKind::Body, "b", "1"),
            (DatumKind::Garment, "tee", "2"),
            (DatumKind::Clip, "walk", "3"),
        ]);
        let now = list(&[
            (DatumKind::Body, "b", "1"),
            (DatumKind::Garment, "tee", "5"),
            (DatumKind::Garment, "coat", "4"),
        ]);
        let changes: Vec<_> = now.changes_since(&before).into_iter().map(|c| (c.key, c.text)).collect();
        assert_eq!(
            changes,
            [
                ("data.garments", "garment coat: 4 now; missing in the checkpoint".to_owned()),
                ("data.garments", "garment tee: 5 now; 2 in the checkpoint".to_owned()),
                ("data.poses", "clip walk: missing now; 3 in the checkpoint".to_owned()),
            ]
        );
        assert!(now.changes_since(&now).is_empty());
    }
}
