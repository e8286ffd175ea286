//! Configurations as a tired hand, a bad merge or a bad disk leaves them: an error with a reason or a run, never a panic.
//!
//! `scripts/fuzz.sh` runs many more cases (`CLOTHCOMBO_FUZZ_CASES`, `CLOTHCOMBO_FUZZ_SEED`).

use clothcombo_tests::{TINY, fuzz_cases};
use clothcombo_trainer::config::{ConfigError, parse, to_toml};
use clothcombo_trainer::training::schedule::Schedule;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// What values, keys and lines are replaced with.
const TOKENS: [&str; 36] = [
    "0",
    "-1",
    "1",
    "1e308",
    "-1e-320",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "18446744073709551616",
    "0.0",
    "-0.0",
    "\"\"",
    "\"single\"",
    "\"all\"",
    "\"untangling\"",
    "[]",
    "[1, 1]",
    "[6, 2]",
    "[0, 0]",
    "[1, 2, 3]",
    "{}",
    "{ from = 0.0, to = 0.0, shape = \"geometric\" }",
    "{ from = 1.0, to = 2.0, start = 2.0 }",
    "true",
    "'",
    "\"",
    "[[",
    "]]",
    "=",
    "\u{0}",
    "🧥",
    "steps",
    "stages",
    "data",
    "1979-05-27T07:32:00Z",
];

/// The files that users start from, and one that says everything.
fn seeds() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let mut texts: Vec<String> = ["smoke.toml", "open.toml", "paper.toml"]
        .into_iter()
        .map(|name| std::fs::read_to_string(folder.join(name)).unwrap())
        .collect();
    texts.push(TINY.to_owned());
    let resolved: Vec<String> =
        texts.iter().map(|t| to_toml(&parse(t, Path::new("seed.toml"), &[]).unwrap()).unwrap()).collect();
    texts.extend(resolved);
    texts
}

fn mutated(texts: &[String], rng: &mut ChaCha8Rng) -> String {
    let mut lines: Vec<String> = texts[rng.random_range(0..texts.len())].lines().map(str::to_owned).collect();
    for _ in 0..rng.random_range(1..4) {
        if lines.is_empty() {
            break;
        }
        let at = rng.random_range(0..lines.len());
        let token = TOKENS[rng.random_range(0..TOKENS.len())];
        match rng.random_range(0..8) {
            0 => drop(lines.remove(at)),
            1 => {
                let other = &texts[rng.random_range(0..texts.len())];
                let other: Vec<&str> = other.lines().collect();
                lines.insert(at, other[rng.random_range(0..other.len())].to_owned());
            }
            2 => lines[at] = token.to_owned(),
            3 => {
                let chars: Vec<char> = lines[at].chars().collect();
                let cut = rng.random_range(0..=chars.len());
                lines[at] = chars[..cut].iter().collect();
            }
            4 => {
                let chars: Vec<char> = lines[at].chars().collect();
                let cut = rng.random_range(0..=chars.len());
                let (head, tail) = chars.split_at(cut);
                lines[at] = head.iter().chain(token.chars().collect::<Vec<_>>().iter()).chain(tail).collect();
            }
            // Mostly a value: what stays valid TOML goes deepest.
            _ => {
                if let Some((key, _)) = lines[at].split_once('=') {
                    lines[at] = format!("{key}= {token}");
                }
            }
        }
    }
    lines.join("\n")
}

#[test]
fn a_damaged_configuration_is_refused_with_a_reason_or_is_a_run() {
    let (cases, seed) = fuzz_cases(4000);
    let texts = seeds();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut valid, mut refused) = (0, 0);
    for _ in 0..cases {
        let text = mutated(&texts, &mut rng);
        match parse(&text, Path::new("fuzz.toml"), &[]) {
            Ok(config) => {
                valid += 1;
                let written = to_toml(&config).unwrap_or_else(|e| panic!("{e}\n{text}"));
                let again = parse(&written, Path::new("again.toml"), &[])
                    .unwrap_or_else(|e| panic!("{e:?}\n{written}"));
                assert_eq!(to_toml(&again).unwrap(), written, "{text}");
                let schedule = Schedule::new(&config);
                let total = schedule.total_steps();
                for step in [0, 1, total / 3, total / 2, total - 1, total] {
                    let at = schedule.at(step);
                    assert!(at.learning_rate.is_finite() && at.learning_rate > 0.0, "{at:?}\n{text}");
                    assert!(at.pose_scale.is_finite() && at.pose_scale >= 0.0, "{at:?}\n{text}");
                    let [low, high] = config.stages[at.stage].layers_at(at.stage_progress);
                    assert!(1 <= low && low <= high && high <= config.stages[at.stage].layers[1], "{text}");
                }
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().trim().is_empty(), "{text}");
                if let ConfigError::Inconsistent { place, what, hint, .. } = error {
                    assert!(!place.is_empty() && !what.is_empty() && !hint.is_empty(), "{text}");
                }
            }
        }
    }
    assert!(valid > cases / 20 && refused > cases / 20, "{valid} valid, {refused} refused");
    println!("{cases} configurations: {valid} valid, {refused} refused with a reason");
}

#[test]
fn overrides_are_refused_with_a_reason_or_taken() {
    let (cases, seed) = fuzz_cases(2000);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let keys = [
        "stages.0.steps",
        "stages.9.steps",
        "stages.x",
        "losses.strain.weight",
        "losses.strian",
        "",
        "=",
        ".",
        "..",
        "data",
        "data.garments.0.generate.count",
        "model.width",
        "model.width.x",
        "seed",
        "guard.inject",
        "output",
        "stages.0",
    ];
    for _ in 0..cases {
        let key = keys[rng.random_range(0..keys.len())];
        let setting = match rng.random_range(0..5) {
            0 => key.to_owned(),
            _ => format!("{key}={}", TOKENS[rng.random_range(0..TOKENS.len())]),
        };
        if let Err(error) = parse(TINY, Path::new("tiny.toml"), std::slice::from_ref(&setting)) {
            assert!(!error.to_string().trim().is_empty(), "{setting}");
        }
    }
}
