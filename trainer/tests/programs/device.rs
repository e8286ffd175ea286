//! `--device`: the same names in every build, and one clear message for what a build or machine lacks.

use crate::common::{assert_fails, clothcombo, said, start, tiny};

const FORMS: [&str; 5] = ["auto", "flex", "ndarray", "wgpu:N", "cuda:N"];

#[test]
fn device_of_a_backend_that_is_not_compiled_in_names_feature_and_command() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let (run, out) = (folder.path().join("run"), folder.path().join("out").display().to_string());
    let lacking: [(bool, &str, &str); 3] = [
        (cfg!(feature = "wgpu"), "wgpu", "wgpu"),
        (cfg!(feature = "cuda"), "cuda:1", "cuda"),
        (cfg!(feature = "ndarray"), "ndarray", "ndarray"),
    ];
    for (_, device, feature) in lacking.into_iter().filter(|(compiled, ..)| !compiled) {
        let command = format!("cargo build --release --workspace --bins --features {feature}");
        let words = [&*format!("--device {device}"), "Cargo feature", feature, &command];
        let trained = start(&config, &run, 1).args(["--device", device]).output().unwrap();
        assert_fails(&trained, 1, &words);
        assert!(!run.exists(), "a run folder was left behind");
        let config = config.display().to_string();
        for verb in [
            &["drape", "--garments", "tee.obj", "-o", &out][..],
            &["bench", "step", "--widths", "8"],
            &["bench", "backends", "--devices", device],
            &["config", "check", &config],
        ] {
            let named = if verb.contains(&"--devices") { &[][..] } else { &["--device", device] };
            assert_fails(&clothcombo(&[verb, named].concat()), 1, &words);
        }
        assert!(!folder.path().join("out").exists());
    }
}

#[test]
fn device_that_is_misspelled_lists_the_forms() {
    let output = clothcombo(&["bench", "step", "--device", "gpu"]);
    assert_fails(&output, 2, &FORMS);
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let output =
        start(&config, &folder.path().join("run"), 1).args(["--device", "wgpu:-1"]).output().unwrap();
    assert_fails(&output, 2, &FORMS);
}

#[test]
fn device_auto_is_the_default_and_stands_in_log_and_report() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let train = |name: &str, arguments: &[&str]| {
        let run = folder.path().join(name);
        let output = start(&config, &run, 1).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
        run
    };
    let runs = [train("usual", &[]), train("auto", &["--device", "auto"])];
    let read = |run: &std::path::Path, file: &str| std::fs::read(run.join(file)).unwrap();
    let model = "checkpoints/step-00000060/model.safetensors";
    assert!(read(&runs[0], model) == read(&runs[1], model));
    if cfg!(all(feature = "flex", not(any(feature = "wgpu", feature = "cuda")))) {
        let log = String::from_utf8(read(&runs[1], "log.txt")).unwrap();
        assert!(log.contains("device: processor (flex)"), "{log}");
        let report = String::from_utf8(read(&runs[1], "report.html")).unwrap();
        assert!(report.contains("processor (flex)"));
        let state = String::from_utf8(read(&runs[1], "checkpoints/step-00000060/state.json")).unwrap();
        assert!(
            !state.contains("device"),
            "checkpoints of the usual device are those of earlier programs: {state}"
        );
    }
}

#[test]
#[cfg(feature = "wgpu")]
fn device_number_beyond_the_adapters_lists_them() {
    let output = clothcombo(&["bench", "step", "--device", "wgpu:99"]);
    assert_eq!(output.status.code(), Some(1));
    let message = said(&output);
    assert!(message.contains("--device wgpu:99") && !message.contains("panicked"), "{message}");
    assert!(message.contains("wgpu:0") || message.contains("no adapter was found"), "{message}");
}
