//! What goes into `clothcombo drape`: garments in any unit and orientation, wrong input, models, and a signal in the middle.

use crate::common::holds;
use crate::drape::{SKIRT, TEE, at, drape, failure, report, run_folder, save_motion};
use assert_cmd::Command;
use clothcombo_data::format::{load_mesh, load_tri_mesh, obj};
use clothcombo_data::generate::mannequin;
use clothcombo_physics::mesh::shapes::{icosphere, mapped, tube, union};
use std::fs;
use std::path::Path;

#[test]
fn a_garment_in_other_units_and_axes_is_fitted_and_comes_back_in_its_own_order() {
    let folder = tempfile::tempdir().unwrap();
    let out = at(&folder, "given");
    drape(&["--garments", SKIRT, "-o", &out]).assert().success();
    let skirt = load_tri_mesh(&Path::new(&out).join(format!("{SKIRT}.obj"))).unwrap();
    // Centimetres, z up, every vertex twice, the second in a face without area.
    let mut positions: Vec<[f64; 3]> = Vec::new();
    for [x, y, z] in skirt.positions() {
        positions.extend([[100.0 * x, -100.0 * z, 100.0 * y]; 2]);
    }
    let faces: Vec<Vec<u32>> = skirt
        .faces()
        .iter()
        .map(|f| f.iter().enumerate().map(|(k, v)| 2 * v + k as u32 % 2).collect())
        .collect();
    let messy = at(&folder, "messy.obj");
    obj::save_polygons(Path::new(&messy), &positions, faces.iter().map(|f| f.as_slice()), &[]).unwrap();
    let out = at(&folder, "out");
    drape(&["--garments", &messy, "-o", &out]).assert().success();
    let draped = load_mesh(&Path::new(&out).join("messy.obj")).unwrap();
    assert_eq!(draped.positions.len(), positions.len());
    assert!(draped.polygons().eq(faces.iter().map(|f| f.as_slice())));
    assert!(draped.positions.chunks(2).all(|pair| pair[0] == pair[1]), "welded vertices stay together");
    let report = report(Path::new(&out));
    assert_eq!(report["garments"][0]["fit"]["placement"]["unit"], "cm");
    let repairs = report["garments"][0]["fit"]["repairs"].as_array().unwrap();
    assert!(repairs.iter().any(|repair| repair["kind"] == "welded_vertices"), "{repairs:?}");
}

#[test]
fn wrong_input_names_itself_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = at(&folder, "out");
    fn to<'a>(arguments: &[&'a str], out: &'a str) -> Vec<&'a str> {
        [arguments, &["-o", out]].concat()
    }
    let band = at(&folder, "broken.obj");
    fs::write(&band, "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n").unwrap();
    let cube = at(&folder, "cube.obj");
    fs::write(&cube, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n").unwrap();
    let motion = at(&folder, "arms.npz");
    save_motion(Path::new(&motion), 4);
    let beyond = format!("{motion}:9");
    let many = vec![TEE; 13];
    let ball = |name: &str, scale: f64, x_of_middle: f64| {
        let path = at(&folder, name);
        let mesh = mapped(&icosphere(0.3, 2), |[x, y, z]| [scale * x + x_of_middle, scale * y, scale * z]);
        obj::save(Path::new(&path), mesh.positions(), mesh.faces(), &[]).unwrap();
        path
    };
    let (huge, far) = (ball("huge.obj", 1e3, 0.0), ball("far.obj", 1.0, 100.0));
    let apart = at(&folder, "apart.obj");
    let sleeve = tube(0.2, 0.4, 24, 6);
    let beside = mapped(&sleeve, |[x, y, z]| [x + 1.5, y, z]);
    let pair = union(&[&sleeve, &beside]);
    obj::save(Path::new(&apart), pair.positions(), pair.faces(), &[]).unwrap();
    let cases: Vec<(Vec<&str>, Vec<&str>)> = vec![
        (vec!["--garments", &apart, "--fit", "never"], vec!["apart.obj", "one of its 2 pieces"]),
        (vec!["--garments", &band], vec!["broken.obj:2:", "not finite"]),
        (vec!["--garments", &cube], vec!["cube.obj", "triangles"]),
        (vec!["--garments", "none.obj"], vec!["none.obj"]),
        (vec!["--garments", &huge, "--fit", "never"], vec!["huge.obj", "measures 600"]),
        (vec!["--garments", &far, "--fit", "never"], vec!["far.obj", "beside the body: x from 99.7"]),
        (vec!["--garments", "cloak"], vec!["cloak", TEE]),
        (vec!["--garments", TEE, "--order", "1"], vec!["--order 1", "1 garments"]),
        (
            vec!["--garments", TEE, "--shape", "1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1"],
            vec!["17 shape numbers", "mannequin"],
        ),
        (vec!["--garments", TEE, "--pose", "none.npz"], vec!["none.npz"]),
        (vec!["--garments", TEE, "--pose", "flying"], vec!["--pose flying", "standing, walking, reaching"]),
        (vec!["--garments", TEE, "--pose", &beyond], vec!["arms.npz has 4 frames, no frame 9"]),
        (vec!["--garments", TEE, "--motion", &motion, "--frames", "2..9"], vec!["4 frames"]),
        (vec!["--garments", TEE, "--posed", &cube], vec!["cube.obj", "4 vertices"]),
        (vec!["--garments", TEE, "--body", "none.npz"], vec!["none.npz"]),
        (vec!["--garments", TEE, "--dataset", "none"], vec!["none"]),
        ([&["--garments"][..], &many].concat(), vec!["13 garments", "1 to 12"]),
    ];
    for (arguments, words) in cases {
        let message = failure(&mut drape(&to(&arguments, &out)), 1);
        for word in words {
            assert!(message.contains(word), "{word:?} is missing for {arguments:?} in:\n{message}");
        }
    }
    failure(&mut drape(&to(&[], &out)), 2);
    let message = failure(&mut drape(&to(&["--garments", TEE, "--gap", "0"], &out)), 2);
    assert!(message.contains("--gap") && message.contains("at most 50 mm"), "{message}");
    failure(&mut drape(&to(&["--outfits", &band, "--order", "1,0"], &out)), 2);
    let inner = format!("{out}/cache");
    let message = failure(&mut drape(&to(&["--garments", TEE, "--cache", &inner], &out)), 1);
    assert!(message.contains("--cache") && holds(&message, "folder that is to be made"), "{message}");
    let name = folder.path().file_name().unwrap().display();
    let around = format!("{}/../{name}/out/cache", folder.path().display());
    let message = failure(&mut drape(&to(&["--garments", TEE, "--cache", &around], &out)), 1);
    assert!(holds(&message, "folder that is to be made"), "{message}");
    // Neither are the folders it was to lie in.
    failure(&mut drape(&["--garments", &band, "-o", &at(&folder, "new/er/out")]), 1);
    assert!(!folder.path().join("new").exists());
    failure(&mut drape(&to(&["--garments", TEE, "--frames", "0..4"], &out)), 2);
    failure(&mut drape(&to(&["--garments", TEE, "--motion", &motion, "--frames", "4..1"], &out)), 2);
    assert!(!Path::new(&out).exists());

    // A folder with something else in it is never touched.
    fs::create_dir(&out).unwrap();
    fs::write(Path::new(&out).join("thesis.tex"), "x").unwrap();
    assert!(failure(&mut drape(&to(&["--garments", TEE], &out)), 1).contains("not empty"));
    assert!(failure(&mut drape(&to(&["--garments", TEE, "--replace"], &out)), 1).contains("not written by"));
    assert_eq!(fs::read_dir(&out).unwrap().count(), 1);
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|n| !n.to_string_lossy().ends_with(".tmp")), "{left:?}");
}

#[test]
fn a_body_mesh_in_another_unit_or_place_is_named_with_its_flag() {
    let folder = tempfile::tempdir().unwrap();
    let out = at(&folder, "out");
    let person = |name: &str, scale: f64, x_of_middle: f64| {
        let (path, body) = (at(&folder, name), mannequin());
        let moved = body.template.iter().map(|[x, y, z]| [scale * x + x_of_middle, scale * y, scale * z]);
        obj::save(Path::new(&path), &moved.collect::<Vec<_>>(), &body.faces, &[]).unwrap();
        path
    };
    let good = person("good.obj", 1.0, 0.0);
    let (in_cm, remote) = (person("in_cm.obj", 100.0, 0.0), person("remote.obj", 1.0, 2000.0));
    for (arguments, words) in [
        (vec!["--posed", &in_cm], ["× --posed", "in_cm.obj: the mesh measures 1"]),
        (vec!["--posed", &remote], ["× --posed", "remote.obj: vertex 0 (from 0) is at ["]),
        (vec!["--posed", &good, "--t-pose", &in_cm], ["× --t-pose", "in_cm.obj: the mesh measures 1"]),
    ] {
        let message = failure(drape(&["--garments", TEE, "-o", &out]).args(&arguments), 1);
        for word in words.into_iter().chain(["help: the mesh must be a pose of the body model", "metres"]) {
            assert!(holds(&message, word), "{word:?} is missing for {arguments:?} in:\n{message}");
        }
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn numbers_that_make_no_sense_are_refused_with_their_flag() {
    let folder = tempfile::tempdir().unwrap();
    for (flag, value, words) in [
        ("--refine", "100000", "it must be at most 1000 steps, or auto"),
        ("--shape", "0.5,nan", "a finite number from -20 to 20"),
        ("--shape", "1e9", "a finite number from -20 to 20"),
    ] {
        let message = failure(drape(&["--garments", TEE, "-o", &at(&folder, "out")]).args([flag, value]), 2);
        assert!(message.contains(flag) && message.contains(words), "{message}");
    }
}

#[test]
fn a_wrong_name_in_the_last_outfit_is_told_before_anything_is_draped() {
    let folder = tempfile::tempdir().unwrap();
    let [file, out, cache, motion] =
        ["outfits.toml", "out", "cache", "arms.npz"].map(|name| at(&folder, name));
    save_motion(Path::new(&motion), 4);
    let good = format!("[[outfit]]\nname = \"good\"\ngarments = [\"{TEE}\"]\n");
    let thirteen = vec![format!("\"{TEE}\""); 13].join(", ");
    for (bad, word) in [
        (format!("garments = [\"{TEE}\"]\nshape = [1e9]"), "1000000000 makes no body"),
        (format!("garments = [\"{TEE}\"]\nshape = [{}]", ["1"; 17].join(", ")), "17 shape numbers"),
        (format!("garments = [{thirteen}]"), "13 garments"),
        (format!("garments = [\"{TEE}\"]\npose = \"{motion}:9\""), "no frame 9"),
        ("garments = [\"cloak\"]".to_owned(), "cloak"),
        (format!("garments = [\"{SKIRT}\", \"{TEE}\"]\norder = [1]"), "--order"),
    ] {
        fs::write(&file, format!("{good}[[outfit]]\nname = \"bad one\"\n{bad}\n")).unwrap();
        let message = failure(&mut drape(&["--outfits", &file, "--cache", &cache, "-o", &out]), 1);
        assert!(holds(&message, "outfit bad one") && holds(&message, word), "{message}");
        // The embedding of the good one would lie in the cache.
        assert!(!Path::new(&out).exists() && fs::read_dir(&cache).unwrap().next().is_none(), "{message}");
    }
}

#[test]
fn frames_of_the_command_line_are_for_outfits_in_motion() {
    let folder = tempfile::tempdir().unwrap();
    let [file, out, motion] = ["outfits.toml", "out", "arms.npz"].map(|name| at(&folder, name));
    save_motion(Path::new(&motion), 4);
    let still = format!("[[outfit]]\nname = \"still\"\ngarments = [\"{TEE}\"]\npose = \"{motion}:3\"\n");
    fs::write(&file, &still).unwrap();
    let arguments = ["--outfits", &file, "--frames", "1..4", "--every", "2", "-o", &out];
    let message = failure(&mut drape(&arguments), 1);
    assert!(holds(&message, "no outfit of") && holds(&message, "has a motion"), "{message}");
    fs::write(
        &file,
        format!("{still}[[outfit]]\nname = \"moving\"\ngarments = [\"{TEE}\"]\nmotion = \"{motion}\"\n"),
    )
    .unwrap();
    drape(&arguments).assert().success();
    let frames = |name: &str| report(&Path::new(&out).join(name))["frames"].as_array().map_or(0, Vec::len);
    assert_eq!((frames("still"), frames("moving")), (0, 2));
}

#[test]
fn a_model_is_three_files_and_a_damaged_or_missing_one_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let newest = fs::read_to_string(run_folder().join("checkpoints/latest")).unwrap();
    let checkpoint = run_folder().join("checkpoints").join(newest.trim());
    let models = folder.path().join("models");
    let model = models.join("tiny");
    fs::create_dir_all(&model).unwrap();
    for file in ["model.safetensors", "config.toml", "state.json"] {
        fs::copy(checkpoint.join(file), model.join(file)).unwrap();
    }
    let run = |arguments: &[&str]| {
        let mut command = Command::cargo_bin("clothcombo").unwrap();
        command.env("NO_COLOR", "1").current_dir(folder.path()).args([
            "drape",
            "--no-cache",
            "--garments",
            TEE,
        ]);
        command.args(arguments);
        command
    };
    // Its parameters are those of the checkpoint.
    run(&["-o", "a", "--checkpoint", "models/tiny"]).assert().success();
    run(&["-o", "b", "--checkpoint", "models/tiny/model.safetensors"]).assert().success();
    drape(&["--garments", TEE, "-o", &at(&folder, "c")]).assert().success();
    let read = |name: &str| fs::read(folder.path().join(name).join(format!("{TEE}.obj"))).unwrap();
    assert!(read("a") == read("b") && read("a") == read("c"));

    let mut bytes = fs::read(model.join("model.safetensors")).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(model.join("model.safetensors"), bytes).unwrap();
    let damaged = failure(&mut run(&["-o", "d", "--checkpoint", "models/tiny"]), 1);
    assert!(damaged.contains("model.safetensors does not match its checksum"));
    // The shipped model is part of the program: a folder with nothing in it is enough.
    fs::remove_dir_all(&models).unwrap();
    let mut shipped = Command::cargo_bin("clothcombo").unwrap();
    let garments = ["drape", "--no-cache", "--no-resolve", "--garments", "skirt_000005", "-o", "d"];
    shipped.current_dir(folder.path()).args(garments).assert().success();
    assert_eq!(report(&folder.path().join("d"))["model"]["folder"], "built in");
}

#[test]
fn garments_that_do_not_lie_on_the_body_as_they_are_are_fitted() {
    let folder = tempfile::tempdir().unwrap();
    let plain = at(&folder, "plain");
    drape(&["--garments", TEE, "--shape", "-0.5,1", "-o", &plain]).assert().success();
    let rest = folder.path().join("made");
    // The garment itself as a file, inside out, and one a hundred times as large in a folder.
    let made = Command::cargo_bin("clothcombo")
        .unwrap()
        .args([
            "generate",
            "--count",
            "1",
            "--seed",
            "5",
            "--vertices",
            "250",
            "--categories",
            "t_shirt",
            "-o",
        ])
        .arg(&rest)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let text = fs::read_to_string(rest.join(format!("{TEE}.obj"))).unwrap();
    let changed = |change: &dyn Fn(&[&str]) -> Option<String>| -> String {
        text.lines()
            .map(|l| change(&l.split(' ').collect::<Vec<_>>()).unwrap_or(l.to_owned()) + "\n")
            .collect()
    };
    let turned = changed(&|words| match words {
        ["f", a, b, c] => Some(format!("f {a} {c} {b}")),
        _ => None,
    });
    let large = changed(&|words| match words {
        ["v", x, y, z] => {
            let [x, y, z] = [x, y, z].map(|v| 100.0 * v.parse::<f64>().unwrap());
            Some(format!("v {x} {y} {z}"))
        }
        _ => None,
    });
    let garments = folder.path().join("garments");
    fs::create_dir(&garments).unwrap();
    fs::write(folder.path().join("turned.obj"), turned).unwrap();
    fs::write(garments.join("large.obj"), large).unwrap();
    let (turned, garments, out) = (at(&folder, "turned.obj"), at(&folder, "garments"), at(&folder, "out"));
    drape(&["--garments", &turned, "large", "--dataset", &garments, "-o", &out]).assert().success();
    let report = report(Path::new(&out));
    let fit = |garment: usize| &report["garments"][garment]["fit"];
    assert_eq!(fit(0)["repairs"][0]["kind"].as_str(), Some("turned_faces"), "{}", fit(0));
    assert_eq!(fit(1)["placement"]["unit"].as_str(), Some("cm"), "{}", fit(1));
}

#[cfg(unix)]
#[test]
fn a_signal_ends_a_drape_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let motion = at(&folder, "arms.npz");
    save_motion(Path::new(&motion), 400);
    let mut drape = std::process::Command::new(env!("CARGO_BIN_EXE_clothcombo"))
        .args(["drape", "--quiet", "--no-cache", "--checkpoint"])
        .arg(run_folder())
        .args(["--garments", TEE, "--motion", &motion, "-o", &at(&folder, "out")])
        .spawn()
        .unwrap();
    let left = || fs::read_dir(folder.path()).unwrap().count();
    let begun = std::time::Instant::now();
    while left() == 1 {
        assert!(begun.elapsed().as_secs() < 60 && drape.try_wait().unwrap().is_none(), "it never began");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    // The handler is there a moment after the folder.
    std::thread::sleep(std::time::Duration::from_millis(200));
    let sent = std::process::Command::new("kill").args(["-TERM", &drape.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert_eq!(drape.wait().unwrap().code(), Some(130));
    assert_eq!(left(), 1, "something beside the motion is left");
}

#[test]
fn a_named_garment_goes_where_the_hints_say_or_they_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = at(&folder, "out");
    for hint in [["--offset", "0,0.05,0"], ["--turn", "10"]] {
        let message = failure(drape(&["--garments", TEE, "-o", &out]).args(hint), 1);
        assert!(message.contains("made by the generator") && message.contains("--outfits"), "{message}");
    }
    drape(&["--garments", TEE, "-o", &at(&folder, "made")]).assert().success();
    let dataset = at(&folder, "garments");
    fs::create_dir(&dataset).unwrap();
    fs::copy(Path::new(&at(&folder, "made")).join(format!("{TEE}.obj")), Path::new(&dataset).join("own.obj"))
        .unwrap();
    let mut named = drape(&["--garments", "own", "--dataset", &dataset, "-o", &out]);
    named.args(["--offset", "0,0,0", "--turn", "-0"]).assert().success();
    assert!(report(Path::new(&out))["garments"][0]["fit"].is_object(), "it was taken where it lay");
}

#[test]
fn what_begins_like_a_negative_number_is_refused_as_a_value() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, out) = (at(&folder, "arms.npz"), at(&folder, "out"));
    save_motion(Path::new(&motion), 4);
    let arguments = ["--garments", TEE, "--motion", &motion, "-o", &out];
    for (flag, value, words) in [
        ("--frames", "-1..3", "no range of frames"),
        ("--join-seams", "-5mm", "--join-seams"),
        ("--order", "-1,0", "it must not be negative"),
        ("--shape", "-1,x", "it is no number"),
    ] {
        let message = failure(drape(&arguments).args([flag, value]), 2);
        assert!(message.contains(words) && !message.contains("unexpected argument"), "{message}");
    }
}
