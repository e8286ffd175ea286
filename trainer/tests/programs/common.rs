//! A training run of a second or two, as the program runs it.

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Sixty steps in three stages with a checkpoint every ten: every network, up to three layers.
pub const TINY: &str = include_str!("../../../tests/fixtures/tiny.toml");

/// `config` with networks so small that a step takes milliseconds.
pub fn with_small_networks(config: &str) -> String {
    format!(
        "{config}[model]\nwidth = 8\nembedding = 8\ndiffusion_blocks = 1\ndiffusion_width = 8\neigen_count = 8\nmlp_layers = 2\n\
         siren_layers = 2\nsiren_width = 8\nskinning_layers = 1\nskinning_width = 8\n"
    )
}

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

/// Checks that a program failed with `code` and without a panic, and that its message holds every one of `words`.
pub fn assert_fails(output: &Output, code: i32, words: &[&str]) {
    let message = said(output);
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    for word in words {
        assert!(holds(&message, word), "{word:?} is missing in:\n{message}");
    }
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
