//! Names of keys that changed, and messages of the parser that say more to a user in other words.

/// Earlier names of keys that files may still have (`serde`'s aliases), and the present ones.
const EARLIER: [(&str, &str); 2] = [("alone", "single_garments"), ("scenes_per_step", "bodies")];

/// What the parser says, and what is said instead.
const REWORDED: [(&str, &str); 2] = [
    (
        "unknown field `held_out_clips`",
        "unknown field `held_out_clips`: it is now data.poses.validation_clips (scored by every validation of the run) and \
         data.poses.test_clips (read by `clothcombo eval` only)",
    ),
    ("invalid type: unit variant, expected string only", "it must be one name"),
];

/// The present name of a key.
pub(super) fn present_name(key: &str) -> &str {
    EARLIER.iter().find(|(earlier, _)| *earlier == key).map_or(key, |(_, present)| present)
}

/// The message of a parser in words that help.
pub(super) fn reworded(message: &str) -> String {
    let known = REWORDED.iter().find(|(theirs, _)| message.contains(theirs));
    let message = known.map_or(message, |(_, ours)| ours);
    // Names of types are the code's.
    let words: Vec<&str> = message.split(' ').collect();
    let said = |at: usize| match (at.checked_sub(1).map(|before| words[before]), words[at]) {
        (Some("struct"), _) => None,
        (_, "struct") => Some("a table"),
        (_, "u64" | "u32" | "usize") => Some("a whole number from 0"),
        (_, "f64" | "f32") => Some("a number"),
        (_, word) => Some(word),
    };
    (0..words.len()).filter_map(said).collect::<Vec<_>>().join(" ")
}
