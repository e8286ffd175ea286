use super::*;
use crate::asset::{Category, Garment, Motion, Pose, Provenance};
use crate::folders::save_garment_folder;
use crate::format::obj;
use crate::generate::{GarmentGenerator, mannequin};
use std::fs;

fn by_name<'a>(files: &'a [FileCheck], name: &str) -> &'a FileCheck {
    files.iter().find(|f| f.path.ends_with(name)).unwrap()
}

#[test]
fn a_dataset_with_good_and_bad_files_is_told_apart() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    let garments =
        [Category::Skirt, Category::TShirt].map(|category| generator.generate(category, 1, 400).unwrap());
    let skirt: &Garment = &garments[0];
    let folder = tempfile::tempdir().unwrap();
    let listed = folder.path().join("listed");
    save_garment_folder(&listed, &garments).unwrap();
    let manifest = fs::read_to_string(listed.join(MANIFEST)).unwrap();
    fs::write(listed.join(MANIFEST), manifest.replace("name =", "layer = [2, 3]\nname =")).unwrap();
    fs::write(listed.join("unlisted.obj"), "not read").unwrap();
    let loose = folder.path().join("loose");
    let inside: Vec<[f64; 3]> =
        skirt.rest.positions().iter().map(|p| [0.8 * p[0], p[1], 0.8 * p[2]]).collect();
    obj::save(&loose.join("tight.obj"), &inside, skirt.rest.faces(), &[]).unwrap();
    let far: Vec<[f64; 3]> = skirt.rest.positions().iter().map(|p| p.map(|x| 100.0 * x)).collect();
    obj::save(&loose.join("centimetres.obj"), &far, skirt.rest.faces(), &[]).unwrap();
    fs::write(loose.join("broken.stl"), "solid\nfacet\n vertex 0 0 z\n").unwrap();
    body.save(&folder.path().join("body.npz"), &Provenance::default()).unwrap();
    let mut inside_out = body.clone();
    inside_out.faces = body.faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
    inside_out.save(&folder.path().join("inside_out.npz"), &Provenance::default()).unwrap();
    let mut poses = vec![Pose::t_pose(22); 4];
    poses[3].rotations[4] = [-1.0, 0.0, 0.0];
    let motion = Motion { name: String::new(), frame_rate: 2.0, poses, source: Provenance::default() };
    motion.save(&folder.path().join("motions/knee.npz")).unwrap();
    fs::write(folder.path().join("motions/cut.npz"), b"PK").unwrap();
    let twice = folder.path().join("twice");
    obj::save(&twice.join("a.obj"), skirt.rest.positions(), skirt.rest.faces(), &[]).unwrap();
    fs::write(twice.join("garments.toml"), "[[garment]]\nfile = \"a.obj\"\n".repeat(2)).unwrap();

    let targets = find_targets(&[folder.path().to_path_buf(), folder.path().join("missing")]);
    let checker = Checker::new(body);
    let files: Vec<FileCheck> = targets.iter().map(|t| checker.check(t)).collect();
    let unusable: Vec<&str> = files
        .iter()
        .filter(|f| f.unusable.is_some())
        .map(|f| f.path.file_name().unwrap().to_str().unwrap())
        .collect();
    assert_eq!(
        unusable,
        ["broken.stl", "centimetres.obj", "tight.obj", "cut.npz", "garments.toml", "missing"]
    );
    let unlisted = by_name(&files, "unlisted.obj");
    assert!(unlisted.garment.is_none() && unlisted.warnings.iter().any(|w| w.contains("garments.toml")));

    let good = by_name(&files, &format!("{}.obj", skirt.name));
    let check = good.garment.as_ref().unwrap();
    assert!(good.warnings.is_empty(), "{:?}", good.warnings);
    assert_eq!((check.category, check.category_guessed), (Category::Skirt, false));
    assert_eq!((check.layer, check.holding), ([2, 3], skirt.holding));
    assert_eq!((check.inside, check.body_triangle_pairs, check.mesh.components), (0, 0, 1));
    assert!(check.distance_min_mm > 3.0 && check.distance_median_mm > check.distance_min_mm);
    let tight = by_name(&files, "tight.obj").garment.as_ref().unwrap();
    assert!(tight.inside > 0 && tight.body_triangle_pairs > 0 && tight.category_guessed);
    let centimetres = by_name(&files, "centimetres.obj");
    assert!(centimetres.unusable.as_ref().unwrap().contains("not in metres"), "{centimetres:?}");

    let body = by_name(&files, "body.npz").body.as_ref().unwrap();
    assert_eq!((body.joints, body.components, body.boundary_loops), (checker.body.joint_count(), 1, 0));
    assert!(body.weight_sums.iter().all(|s| (s - 1.0).abs() < 1e-5));
    let inside_out = by_name(&files, "inside_out.npz");
    assert!(!body.inside_out && inside_out.body.as_ref().unwrap().inside_out);
    assert!(inside_out.warnings.iter().any(|w| w.contains("inside out")), "{:?}", inside_out.warnings);
    let knee = by_name(&files, "knee.npz").motion.as_ref().unwrap();
    assert_eq!((knee.frames, knee.frames_outside_limits, knee.duration), (4, 1, 2.0));
    assert_eq!(knee.joints_outside_limits.get("left_knee"), Some(&1));
    assert!((knee.largest_excess_degrees - 57.3).abs() < 0.1);
    assert!(serde_json::to_string(&files).unwrap().contains("\"distance_median_mm\""));
}

#[test]
fn layers_are_guessed_from_the_distance() {
    assert_eq!(layer_guess(0.004, Category::Top), [1, 2]);
    assert_eq!(layer_guess(0.004, Category::OpenShirt), [2, 3]);
    assert_eq!(layer_guess(0.05, Category::Dress), [3, 4]);
}

#[cfg(unix)]
#[test]
fn links_that_lead_back_and_names_that_are_no_text_do_no_harm() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.obj");
    fs::write(folder.path().join(name), "v 0 0 0\n").unwrap();
    std::os::unix::fs::symlink(folder.path(), folder.path().join("again")).unwrap();
    let targets = find_targets(&[folder.path().to_path_buf()]);
    assert_eq!(targets.len(), 1);
    let json = serde_json::to_value(Checker::new(mannequin()).check(&targets[0])).unwrap();
    assert!(json["path"].as_str().unwrap().ends_with(".obj") && json["unusable"].is_string(), "{json}");
}
