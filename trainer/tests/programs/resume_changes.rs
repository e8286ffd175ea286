//! What may change between two sessions of a run, and what is said of what may not.

use crate::common::{assert_fails, clothcombo, resume, said, start, tiny, trainer, with_small_networks};
use std::path::Path;

const FEW: [&str; 6] =
    ["--set", "stages.0.steps=2", "--set", "stages.1.steps=1", "--set", "stages.2.steps=1"];

#[test]
fn a_wrong_start_leaves_nothing_and_blocks_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let model = folder.path().join("model");
    assert!(start(&config, &model, 1).args(FEW).status().unwrap().success());
    let parent = folder.path().join("deep");
    let run = parent.join("runs/run");
    let from = |path: &Path, more: &[&str]| {
        let init = format!("init_from={:?}", path.display().to_string());
        start(&config, &run, 1)
            .args(FEW)
            .args(["--set", "seed=9", "--set", &init])
            .args(more)
            .output()
            .unwrap()
    };
    let assert_refused = |output, words: &[&str]| {
        assert_fails(&output, 1, words);
        assert!(!parent.exists(), "something was left behind");
    };
    assert_refused(from(&folder.path().join("nope"), &[]), &["init_from", "there is no model in", "nope"]);
    let wide = ["--set", "model.width=24"];
    assert_refused(from(&model, &wide), &["model.width: 24 in the configuration, 16 in the model"]);
    let shapes = ["--set", "data.shape_components=2"];
    assert_refused(from(&model, &shapes), &["shape components"]);
    let device = start(&config, &run, 1).args(["--device", "cuda:77"]).output().unwrap();
    assert_refused(device, &["cuda"]);
    // Garments that carry fewer joints are no obstacle, for the networks see the joints they know.
    let good = from(&model, &["--set", "data.garments.0.generate.count=2"]);
    assert!(good.status.success(), "{}", said(&good));
    let file = config.join("run");
    assert_fails(&start(&config, &file, 1).output().unwrap(), 1, &["is a file, not a folder"]);
}

#[test]
fn changed_networks_and_changed_data_are_told_with_both_values() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = folder.path().join("run");
    assert!(start(&config, &run, 1).args(FEW).status().unwrap().success());
    let wide = ["--set", "model.width=24"];
    let refused = resume(&run, 1).args(wide).output().unwrap();
    assert_fails(
        &refused,
        1,
        &["model.width: 24 in the configuration, 16 in the run", "--allow-config-change"],
    );
    let refused = resume(&run, 1).args(wide).args(["--allow-config-change", "model"]).output().unwrap();
    assert_fails(
        &refused,
        1,
        &["model.width: 24 in the configuration, 16 in the checkpoint", "step-00000004"],
    );
    let message = said(&refused);
    assert!(message.lines().count() < 12 && !message.contains("damaged"), "{message}");
    let fewer = ["--set", "data.garments.0.generate.count=2", "--set", "stages.2.steps=2"];
    let refused = resume(&run, 1).args(fewer).args(["--allow-config-change", "stages"]).output().unwrap();
    assert_fails(&refused, 1, &["data.garments[0].generate.count: 2 in the configuration, 3 in the run"]);
    let allowed =
        resume(&run, 1).args(fewer).args(["--allow-config-change", "stages,data"]).output().unwrap();
    assert!(allowed.status.success(), "{}", said(&allowed));
    assert!(run.join("checkpoints/step-00000005").exists());
    // From here on it is the run's own.
    assert!(resume(&run, 1).status().unwrap().success());
}

#[test]
fn a_run_resumes_from_any_folder_wherever_it_was_moved() {
    let folder = tempfile::tempdir().unwrap();
    let [project, elsewhere] = ["project", "elsewhere"].map(|name| folder.path().join(name));
    [&project, &elsewhere].iter().for_each(|path| std::fs::create_dir(path).unwrap());
    let clothes = project.join("clothes").display().to_string();
    let made = clothcombo(&[
        "generate",
        "--count",
        "2",
        "--vertices",
        "250",
        "--categories",
        "top,skirt",
        "-o",
        &clothes,
    ]);
    assert!(made.status.success(), "{}", said(&made));
    let text = "seed = 1\n[data]\ncache = { folder = \"cache\" }\n[[data.garments]]\nfolder = \"clothes\"\n[[stages]]\n\
        name = \"single\"\ntrains = \"single\"\nsteps = 2\n[validation]\nsingle_scenes = 1\nlayered_scenes = 0\n\
        [output]\nsample_scenes = 0\n";
    std::fs::write(project.join("own.toml"), with_small_networks(text)).unwrap();
    let within = |place: &Path, arguments: &[&str]| {
        let output = trainer(1, arguments).current_dir(place).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
    };
    within(&project, &["--config", "own.toml"]);
    let more = |steps: u32| format!("stages.0.steps={steps}");
    let allow = ["--allow-config-change", "stages", "--set"];
    within(&elsewhere, &[&["--resume", "../project/runs/own"], &allow[..], &[&more(3)]].concat());
    std::fs::rename(project.join("runs/own"), elsewhere.join("moved")).unwrap();
    within(folder.path(), &[&["--resume", "elsewhere/moved"], &allow[..], &[&more(4)]].concat());
    // The configuration that it was started with is the same one, wherever it is read.
    within(&project, &["--config", "own.toml", "--resume", "../elsewhere/moved", "--set", &more(4)]);
    assert!(elsewhere.join("moved/checkpoints/step-00000004").exists());
    assert!(!elsewhere.join("cache").exists() && project.join("cache").exists());
    for file in ["moved/config.toml", "moved/checkpoints/step-00000004/config.toml"] {
        let text = std::fs::read_to_string(elsewhere.join(file)).unwrap();
        assert!(text.contains("folder = \"clothes\"") && text.contains("base = "), "{text}");
    }
}

#[test]
fn advice_names_an_older_checkpoint_only_where_there_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = folder.path().join("run");
    assert!(start(&config, &run, 1).args(FEW).status().unwrap().success());
    let checkpoints = run.join("checkpoints");
    let spoil = |name: &str| std::fs::write(checkpoints.join(name).join("model.bpk"), "x").unwrap();
    let at = |name: &str| {
        trainer(1, &["--resume", &checkpoints.join(name).display().to_string()]).output().unwrap()
    };
    spoil("step-00000004");
    assert_fails(&at("step-00000004"), 1, &["an older checkpoint of the run is", "step-00000003"]);
    let mut names: Vec<_> =
        std::fs::read_dir(&checkpoints).unwrap().flatten().map(|e| e.file_name()).collect();
    names.retain(|name| name.to_string_lossy().starts_with("step-"));
    names.sort();
    names.iter().for_each(|name| spoil(&name.to_string_lossy()));
    assert_fails(&at(&names[0].to_string_lossy()), 1, &["there is no older one"]);
    let none = resume(&run, 1).output().unwrap();
    assert_fails(&none, 1, &["none of the", "checkpoints in", "can be used", "start a new run"]);
    assert!(!said(&none).contains("an older checkpoint"), "{}", said(&none));
    let listed = clothcombo(&["runs", &folder.path().display().to_string()]);
    let table = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert!(table.lines().any(|line| line.starts_with("run  unreadable  none of the")), "{table}");
}
