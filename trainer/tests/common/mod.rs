//! A training run of a second or two, as the program runs it.

// Every test program uses its own part of this.
#![allow(dead_code)]

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Sixty steps in three stages with a checkpoint every ten: every network, up to three layers.
pub const TINY: &str = r#"
seed = 3
[data]
body = "mannequin"
poses = { max_self_intersection = 10.0 }
[[data.garments]]
generate = { count = 3, seed = 5, vertices = 200, categories = ["t_shirt", "trousers", "skirt"] }
[model]
width = 16
embedding = 16
diffusion_blocks = 2
diffusion_width = 16
eigen_count = 12
mlp_layers = 4
siren_layers = 3
siren_width = 16
skinning_layers = 2
skinning_width = 16
[[stages]]
name = "single"
trains = "single"
steps = 20
learning_rate = 1e-3
pose_scale = { from = 0.0, to = 1.0, start = 0.0, end = 0.5 }
[[stages]]
name = "untangling"
trains = "untangling"
steps = 20
layers = [2, 3]
learning_rate = 1e-3
[[stages]]
name = "all"
trains = "all"
steps = 20
layers = [1, 3]
learning_rate = 1e-4
[validation]
single_scenes = 2
layered_scenes = 2
layers = [2, 3]
[output]
checkpoint_every = 10
sample_scenes = 0
"#;

/// The trainer with `arguments`, on `threads` threads, quiet.
pub fn trainer(threads: usize, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
    command.args(arguments).arg("--quiet").env("RAYON_NUM_THREADS", threads.to_string()).env("NO_COLOR", "1");
    command
}

/// A new run.
pub fn start(config: &Path, run: &Path, threads: usize) -> Command {
    let (config, run) = (config.display().to_string(), run.display().to_string());
    trainer(threads, &["--config", &config, "--run-dir", &run])
}

/// A run continued, with its own configuration.
pub fn resume(run: &Path, threads: usize) -> Command {
    trainer(threads, &["--run-dir", &run.display().to_string(), "--resume"])
}

/// The other program with `arguments`.
pub fn clothcombo(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo"));
    command.args(arguments).env("NO_COLOR", "1").stdin(Stdio::null()).output().unwrap()
}

/// What a program said on stderr.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Whether `message` holds `words`, wherever its lines are broken: errors are printed to fit a terminal.
pub fn holds(message: &str, words: &str) -> bool {
    let squeezed = |text: &str| text.chars().filter(|c| !c.is_whitespace() && *c != '│').collect::<String>();
    squeezed(message).contains(&squeezed(words))
}

/// Writes [`TINY`] into `folder`, with `more` appended, and returns the file.
pub fn tiny(folder: &Path, more: &str) -> std::path::PathBuf {
    let file = folder.join("tiny.toml");
    std::fs::write(&file, format!("{TINY}{more}")).unwrap();
    file
}
