//! Folders that `clothcombo drape` reads from and writes to: what is read is never replaced, and any name will do.

use crate::common::holds;
use crate::drape::{TEE, at, drape, failure, report};
use clothcombo_data::asset::Provenance;
use clothcombo_data::generate::mannequin;
use std::fs;
use std::path::Path;

#[test]
fn nothing_that_is_read_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let out = at(&folder, "out");
    drape(&["--garments", TEE, "-o", &out]).assert().success();
    let garment = Path::new(&out).join(format!("{TEE}.obj"));
    let before = fs::read(&garment).unwrap();
    let replace = |arguments: &[&str]| {
        let message = failure(&mut drape(&[arguments, &["--replace", "-o", &out]].concat()), 1);
        assert!(holds(&message, "would be replaced"), "{message}");
        assert_eq!(fs::read(&garment).unwrap(), before);
    };
    replace(&["--garments", TEE, "--dataset", &out]);
    replace(&["--garments", TEE, "--body", &garment.display().to_string()]);
    // A name that turns out to stand for a file of the folder.
    #[cfg(unix)]
    {
        let dataset = at(&folder, "dataset");
        fs::create_dir(&dataset).unwrap();
        std::os::unix::fs::symlink(&garment, Path::new(&dataset).join("own.obj")).unwrap();
        replace(&["--garments", "own", "--dataset", &dataset]);
    }
}

#[test]
fn a_dataset_is_searched_through_its_body_is_draped_and_the_table_counts_as_the_certificate() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, data, out] = ["plain", "data", "out"].map(|name| at(&folder, name));
    drape(&["--garments", TEE, "-o", &plain]).assert().success();
    let garments = Path::new(&data).join("garments");
    fs::create_dir_all(&garments).unwrap();
    fs::copy(Path::new(&plain).join(format!("{TEE}.obj")), garments.join("own.obj")).unwrap();
    mannequin().save(&Path::new(&data).join("someone.npz"), &Provenance::default()).unwrap();
    let output =
        drape(&["--garments", "own", "--dataset", &data, "--pose", "walking", "-o", &out]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(Path::new(&out).join("report.json")).unwrap()).unwrap();
    assert_eq!((&report["body"]["name"], &report["body"]["pose"]), (&"someone".into(), &"walking".into()));

    let text = String::from_utf8(output.stdout).unwrap();
    let after = text.lines().find(|line| line.starts_with("own") && line.contains("after")).unwrap();
    let pairs: Vec<&str> = after.split_whitespace().rev().take(3).collect();
    let line = text.lines().find(|line| line.starts_with("certificate")).unwrap();
    let [self_pairs, layer_pairs, body_pairs] = pairs[..] else { panic!("{after}") };
    let said = format!(
        "certificate: {body_pairs} pairs with the body, {layer_pairs} between layers, {self_pairs} of garments with themselves"
    );
    assert!(line.starts_with(&said), "{text}");
}

#[cfg(unix)]
#[test]
fn a_dataset_of_any_name_is_reported() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    drape(&["--garments", TEE, "-o", &out.display().to_string()]).assert().success();
    let dataset = folder.path().join(std::ffi::OsStr::from_bytes(b"garments-\xff"));
    fs::create_dir(&dataset).unwrap();
    fs::copy(out.join(format!("{TEE}.obj")), dataset.join("own.obj")).unwrap();
    let again = folder.path().join("again");
    let mut named = drape(&["--garments", "own", "-o", &again.display().to_string()]);
    named.arg("--dataset").arg(&dataset).assert().success();
    let given = report(&again)["garments"][0]["given"].as_str().unwrap().to_owned();
    assert!(given.contains("garments-\u{fffd}"), "{given}");
}
