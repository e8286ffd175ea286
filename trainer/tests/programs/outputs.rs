//! A file where a folder is to be made, or a folder where a file is to be: every verb says so, and before it works.

use crate::common::{clothcombo, holds, said};

#[test]
fn every_verb_says_what_is_in_the_way_of_its_output() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (file, below) = (at("file"), at("file/below/out"));
    std::fs::write(&file, "").unwrap();
    std::fs::create_dir(at("folder.obj")).unwrap();
    std::fs::write(at("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let mesh = at("a.obj");
    let into_folder: [&[&str]; 6] = [
        &["drape", "--garments", &mesh, "-o"],
        &["resolve", "--body", &mesh, "--garments", &mesh, "-o"],
        &["generate", "--count", "1", "-o"],
        &["eval", "-o"],
        &["import", "amass", &mesh, "-o"],
        &["import", "bvh", &mesh, "-o"],
    ];
    for output in [&file, &below] {
        for verb in into_folder {
            let output = clothcombo(&[verb, &[output.as_str()]].concat());
            assert!(!output.status.success(), "{verb:?}");
            assert!(holds(&said(&output), &format!("{file} is a file, not a folder")), "{}", said(&output));
        }
    }
    for (output, words) in
        [("folder.obj", "it is a folder, not a file"), ("file/x.obj", "is a file, not a folder")]
    {
        for verb in [&["fit", &mesh, "-o"][..], &["import", "smplx", &mesh, "-o"]] {
            let output = clothcombo(&[verb, &[at(output).as_str()]].concat());
            assert!(!output.status.success() && holds(&said(&output), words), "{verb:?}: {}", said(&output));
        }
    }
    assert_eq!(std::fs::metadata(&file).unwrap().len(), 0);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "nothing was made");
}
