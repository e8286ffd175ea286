//! Keys that are gone: an old configuration is refused with the name of what took their place.

/// Old key, and what to write instead.
const RENAMED: [(&str, &str); 1] = [(
    "held_out_clips",
    "it is now data.poses.validation_clips (scored by every validation of the run) and data.poses.test_clips (read by \
     `clothcombo eval` only)",
)];

/// The message of a parser, which names an unknown key in backquotes; if that key had a meaning once, with its successor.
pub(super) fn with_new_name(message: &str) -> String {
    let gone = RENAMED.iter().find(|(old, _)| message.contains(&format!("unknown field `{old}`")));
    match gone {
        Some((old, instead)) => format!("unknown field `{old}`: {instead}"),
        None => message.to_owned(),
    }
}
