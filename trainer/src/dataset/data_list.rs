//! What the data of a run consists of, by name: with it a checkpoint tells which garment, clip or body is another one now.

use super::contents::Dataset;
use clothcombo_data::cache::{KeyBuilder, body_key};
use clothcombo_data::folders::list_motion_folder;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Body, garments and clips, in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DataList(Vec<Datum>);

/// One of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Datum {
    kind: Kind,
    name: String,
    /// What it is, in words that differ where it differs.
    is: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Body,
    Garment,
    Clip,
}

impl Kind {
    /// The key of the configuration that says where it comes from.
    fn key(self) -> &'static str {
        match self {
            Self::Body => "data.body",
            Self::Garment => "data.garments",
            Self::Clip => "data.poses",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Body => "body",
            Self::Garment => "garment",
            Self::Clip => "clip",
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
    /// The list of `dataset`; clips are read once more, as files.
    pub(super) fn of(dataset: &Dataset) -> Self {
        let body = &dataset.body;
        let digest = KeyBuilder::new("body")
            .key(body_key(body))
            .array(body.joint_template.as_flattened())
            .array(body.pose_directions.as_deref().unwrap_or_default())
            .finish();
        let mut all = vec![Datum {
            kind: Kind::Body,
            name: body.name.clone(),
            is: format!("{} vertices, {}", body.vertex_count(), short(&digest.to_string())),
        }];
        all.extend((0..dataset.garments.len()).map(|index| {
            let garment = dataset.garments.info(index);
            let held = if garment.holding { "held" } else { "not held" };
            let (category, vertices, mesh) = (garment.category, garment.vertices, garment.mesh.to_string());
            Datum {
                kind: Kind::Garment,
                name: garment.name.clone(),
                is: format!("{category}, {held}, {vertices} vertices, {}", short(&mesh)),
            }
        }));
        let files = dataset.motions.as_deref().and_then(|folder| list_motion_folder(folder).ok());
        let clips: Vec<Datum> =
            files.unwrap_or_default().par_iter().map(|file| clip(file, dataset)).collect();
        all.extend(clips);
        Self(all)
    }

    /// What is not in this list as it is in `earlier`.
    pub fn changes_since(&self, earlier: &Self) -> Vec<DataChange> {
        let [now, before] = [self, earlier].map(Self::by_name);
        let names: BTreeMap<_, ()> = now.keys().chain(before.keys()).map(|name| (*name, ())).collect();
        let differs = names.into_keys().filter(|name| now.get(name) != before.get(name));
        let change = |(kind, name): (Kind, &str)| {
            let side = |list: &BTreeMap<_, Vec<&str>>, missing: &str| {
                list.get(&(kind, name)).map_or_else(|| missing.to_owned(), |all| all.join(" and "))
            };
            let (is, was) = (side(&now, "missing"), side(&before, "missing"));
            DataChange {
                key: kind.key(),
                text: format!("{} {name}: {is} now; {was} in the checkpoint", kind.name()),
            }
        };
        differs.map(change).collect()
    }

    /// Names are unique within a source only.
    fn by_name(&self) -> BTreeMap<(Kind, &str), Vec<&str>> {
        let mut all: BTreeMap<_, Vec<&str>> = BTreeMap::new();
        for datum in &self.0 {
            all.entry((datum.kind, datum.name.as_str())).or_default().push(&datum.is);
        }
        all
    }
}

fn clip(file: &Path, dataset: &Dataset) -> Datum {
    let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let clips = dataset.poses.clips();
    let purpose = match () {
        () if clips.validation.contains(&name) => "for validation",
        () if clips.test.contains(&name) => "for the test",
        () => "for training",
    };
    let digest =
        fs::read(file).map_or_else(|e| e.to_string(), |bytes| blake3::hash(&bytes).to_hex().to_string());
    Datum { kind: Kind::Clip, name, is: format!("{purpose}, {}", short(&digest)) }
}

fn short(digest: &str) -> &str {
    digest.get(..DIGITS).unwrap_or(digest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_told_by_name_with_both_values() {
        let list = |all: &[(Kind, &str, &str)]| {
            DataList(
                all.iter()
                    .map(|(kind, name, is)| Datum { kind: *kind, name: (*name).into(), is: (*is).into() })
                    .collect(),
            )
        };
        let before = list(&[(Kind::Body, "b", "1"), (Kind::Garment, "tee", "2"), (Kind::Clip, "walk", "3")]);
        let now = list(&[(Kind::Body, "b", "1"), (Kind::Garment, "tee", "5"), (Kind::Garment, "coat", "4")]);
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
