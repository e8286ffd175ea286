//! Messages of the parser that say more to a user in other words: keys that are gone or have another name, values of
//! another kind.

/// What the parser says, and what is said instead.
const REWORDED: [(&str, &str); 3] = [
    (
        "unknown field `held_out_clips`",
        "unknown field `held_out_clips`: it is now data.poses.validation_clips (scored by every validation of the run) and \
         data.poses.test_clips (read by `clothcombo eval` only)",
    ),
    (
        "duplicate field `single_garments`",
        "losses.alone is the old name of losses.single_garments, which is set as well",
    ),
    ("invalid type: unit variant, expected string only", "it must be a name in quotes"),
];

/// The message of a parser in words that help.
pub(super) fn reworded(message: &str) -> String {
    let known = REWORDED.iter().find(|(theirs, _)| message.contains(theirs));
    known.map_or(message, |(_, ours)| ours).to_owned()
}
