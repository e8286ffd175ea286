//! Things that are no garment are refused with a reason, wherever and however their file has them.

use clothcombo_data::asset::{Body, BodyFileSettings};
use clothcombo_data::fit::{FitSettings, fit};
use clothcombo_data::generate::mannequin;
use clothcombo_tests::fuzz_cases;
use clothcombo_tests::objects::{Object, objects};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// The kind of error that refuses an object, or what is wrong.
fn refusal(object: &Object, body: &Body) -> Result<String, String> {
    let attempt = || fit(&object.mesh, body, &FitSettings::default());
    let error = match catch_unwind(AssertUnwindSafe(attempt)) {
        Err(_) => return Err("panics".into()),
        Ok(Ok(fitted)) => {
            let report = fitted.report;
            return Err(format!("fitted as {:?}: {:?}", report.category, report.placement));
        }
        Ok(Err(error)) => error,
    };
    let text = error.to_string();
    let kind = format!("{error:?}");
    let kind = kind.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_owned();
    let is_sentence = !text.trim().is_empty() && !text.contains('\n') && !text.contains(". ");
    // Nothing as a debugger would write it, such as the variant's own name.
    let debug = ["panic", "unwrap", "Some(", "None", "{", "}", "NaN", kind.as_str()];
    match is_sentence && !debug.iter().any(|word| text.contains(word)) {
        true => Ok(kind),
        false => Err(format!("refused with '{text}'")),
    }
}

fn refuses_all(body: &Body, of: &str) {
    let (cases, seed) = fuzz_cases(100);
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    for object in objects(seed, cases) {
        match refusal(&object, body) {
            Ok(kind) => *kinds.entry(kind).or_default() += 1,
            Err(problem) => wrong.push(format!("{}: {problem}", object.name)),
        }
    }
    let refused = cases - wrong.len();
    println!("{cases} objects of seed {seed} on {of}: {refused} refused {kinds:?}, {} not", wrong.len());
    assert!(wrong.is_empty(), "{} of {cases} objects on {of}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn no_object_is_fitted_to_the_mannequin() {
    refuses_all(&mannequin(), "the mannequin");
}

#[test]
fn no_object_is_fitted_to_the_shipped_body() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default/body.npz");
    refuses_all(&Body::load(&file, &BodyFileSettings::default()).unwrap(), "the shipped body");
}

/// As OBJ files in the folder `CLOTHCOMBO_OBJECTS`, or in `target/objects`.
#[test]
#[ignore = "writes files to look at"]
fn objects_can_be_looked_at() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../target/objects");
    let folder = std::env::var("CLOTHCOMBO_OBJECTS").unwrap_or_else(|_| beside.into());
    std::fs::create_dir_all(&folder).unwrap();
    let (cases, seed) = fuzz_cases(100);
    for Object { name, mesh } in objects(seed, cases) {
        let mut text = format!("# {name}\n");
        mesh.positions.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
        for polygon in mesh.polygons() {
            let corners: Vec<String> = polygon.iter().map(|v| (v + 1).to_string()).collect();
            writeln!(text, "f {}", corners.join(" ")).unwrap();
        }
        let file = name.split(',').next().unwrap_or(&name).replace(' ', "_");
        std::fs::write(Path::new(&folder).join(file).with_extension("obj"), text).unwrap();
    }
}
