//! The words and numbers of Acclaim files.

/// The lines of a text without their comments, in words and numbered from 1; empty ones are left out.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let numbered = text.lines().enumerate().map(|(n, line)| {
        let words = line.split('#').next().unwrap_or_default().split_ascii_whitespace();
        (n + 1, words.collect::<Vec<_>>())
    });
    numbered.filter(|(_, words)| !words.is_empty())
}

/// The finite numbers `words` are; `what` they are is for the message.
pub(super) fn numbers(words: &[&str], what: &str) -> Result<Vec<f64>, String> {
    let number = |word: &&str| match word.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("'{word}' is not a finite number ({what})")),
    };
    words.iter().map(number).collect()
}
