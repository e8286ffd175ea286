//! What a garment is made of, from the command line, from a file of outfits and from the manifest of its folder.

use crate::drape::{TEE, at, drape, failure, report};
use clothcombo_data::format::load_tri_mesh;
use std::fs;

/// Positions of the only garment in `folder`.
fn positions(folder: &std::path::Path) -> Vec<[f64; 3]> {
    load_tri_mesh(&folder.join(format!("{TEE}.obj"))).unwrap().positions().to_vec()
}

#[test]
fn the_refinement_knows_what_a_garment_is_made_of_and_the_networks_say_that_they_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, more: &[&str]| {
        let out = at(&folder, name);
        let output = drape(&["--garments", TEE, "-o", &out]).args(more).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        (positions(out.as_ref()), report(out.as_ref()), said)
    };
    let heavy = ["--material", "thickness=0.012,density=2000"];
    let (plain, of_plain, _) = run("plain", &["--refine", "3"]);
    let (thick, of_thick, said) = run("thick", &[&heavy[..], &["--refine", "3"]].concat());
    assert_ne!(plain, thick);
    assert!(of_plain["garments"][0].get("material").is_none());
    assert_eq!(of_thick["garments"][0]["material"]["density"], 2000.0);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("thickness=0.012") && said.contains("were trained with thickness=0.00047"),
        "{said}"
    );
    let alone = ["--refine", "0", "--no-resolve"];
    let (networks, ..) = run("networks", &alone);
    let (of_another, ..) = run("another", &[&heavy[..], &alone].concat());
    assert_eq!(networks, of_another, "the networks do not see the material");
}

#[test]
fn manifests_and_outfits_name_materials_and_mistakes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let outfits = at(&folder, "outfits.toml");
    let entry = |material: &str| {
        let garment = format!("{{ file = \"{TEE}\", material = {{ {material} }} }}");
        fs::write(&outfits, format!("[[outfit]]\ngarments = [{garment}]\n")).unwrap();
    };
    entry("density = 300.0");
    let out = at(&folder, "out");
    let output =
        drape(&["--outfits", &outfits, "--no-resolve", "--refine", "0", "-o", &out]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(report(out.as_ref())["garments"][0]["material"]["density"], 300.0);
    entry("density = -1.0");
    let message = failure(&mut drape(&["--outfits", &outfits, "-o", &at(&folder, "refused")]), 1);
    assert!(message.contains("garment 1") && message.contains("`material.density` is -1"), "{message}");
    let message =
        failure(&mut drape(&["--garments", TEE, "--material", "weight=1", "-o", &at(&folder, "refused")]), 2);
    assert!(
        message.contains("'weight' is no constant") && message.contains("bending_stiffness"),
        "{message}"
    );

    let dataset = folder.path().join("dataset");
    fs::create_dir(&dataset).unwrap();
    fs::copy(folder.path().join("out").join(format!("{TEE}.obj")), dataset.join("shirt.obj")).unwrap();
    fs::write(dataset.join("garments.toml"), "[[garment]]\nfile = \"shirt.obj\"\nmaterial = { mu = 1e4 }\n")
        .unwrap();
    let (named, dataset) = (at(&folder, "named"), dataset.display().to_string());
    let arguments =
        ["--garments", "shirt", "--dataset", &dataset, "--no-resolve", "--refine", "0", "-o", &named];
    let output = drape(&arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(report(named.as_ref())["garments"][0]["material"]["mu"], 1e4);
}
