//! The statements of an OBJ file: its lines, with those that a backslash continues joined.

use std::borrow::Cow;
use std::iter;

/// Left by some editors; taken for a part of the first word it would hide the first vertex.
const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// One statement.
#[derive(Debug, PartialEq)]
pub(super) struct Statement<'a> {
    /// The first of its lines, from 1.
    pub line: usize,
    /// Its text, with a space where it is continued.
    pub text: Cow<'a, [u8]>,
    /// How its last line ends: `\n`, `\r\n`, `\r` (as old systems have it), or not at all at the end of the file.
    pub end: &'a [u8],
}

/// The statements of a file, empty lines and comments included.
pub(super) fn statements(bytes: &[u8]) -> impl Iterator<Item = Statement<'_>> {
    let mut rest = bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes);
    let mut lines = 0;
    iter::from_fn(move || {
        let first = lines + 1;
        let mut text = Cow::Borrowed(&rest[..0]);
        while !rest.is_empty() {
            let (line, end, after) = first_line(rest);
            rest = after;
            lines += 1;
            // A comment's backslash is the end of a path, more often than not.
            match line.strip_suffix(b"\\").filter(|line| !line.contains(&b'#')) {
                Some(line) => {
                    text.to_mut().extend_from_slice(line);
                    text.to_mut().push(b' ');
                }
                None if text.is_empty() => return Some(Statement { line: first, text: line.into(), end }),
                None => {
                    text.to_mut().extend_from_slice(line);
                    return Some(Statement { line: first, text, end });
                }
            }
        }
        (lines >= first).then_some(Statement { line: first, text, end: &[] })
    })
}

/// The first line, how it ends, and what comes after it.
fn first_line(bytes: &[u8]) -> (&[u8], &[u8], &[u8]) {
    let length = bytes.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(bytes.len());
    let (line, rest) = bytes.split_at(length);
    let (end, after) = rest.split_at(if rest.starts_with(b"\r\n") { 2 } else { rest.len().min(1) });
    (line, end, after)
}

impl Statement<'_> {
    /// Its words, the keyword first.
    pub fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
    }

    /// How its line ends in a new file.
    pub fn new_end(&self) -> &[u8] {
        if self.end == b"\r" { b"\n" } else { self.end }
    }
}

/// The file with every statement on a line of its own and no mark of the byte order. What `replaced` writes takes the place of a
/// statement for which it says so; the others stay as they are, to the byte.
pub(super) fn rewritten(bytes: &[u8], mut replaced: impl FnMut(&Statement, &mut Vec<u8>) -> bool) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 4);
    for statement in statements(bytes) {
        if !replaced(&statement, &mut out) {
            out.extend_from_slice(&statement.text);
            out.extend_from_slice(statement.new_end());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::ObjMesh;
    use super::*;
    use std::path::Path;

    const POINTS: &str = "v 1 2 3\nv 0 1 0\nv 0 0 1\n";

    fn parse(text: &str) -> Result<ObjMesh, String> {
        ObjMesh::parse(text, Path::new("shirt.obj")).map_err(|e| e.to_string())
    }

    #[test]
    fn a_mark_of_the_byte_order_hides_no_vertex() {
        let mesh = parse(&format!("\u{feff}{POINTS}f 1 2 3\n")).unwrap();
        assert_eq!((mesh.positions.len(), mesh.positions[0]), (3, [1.0, 2.0, 3.0]));
    }

    #[test]
    fn a_backslash_continues_a_line_and_errors_name_the_first_one() {
        let mesh = parse(&format!("{POINTS}v 1 \\\n 1\\\r\n 1\nf 1 \\\n2 \\\n3\nf 2 3 4\n")).unwrap();
        assert_eq!((mesh.positions[3], mesh.polygons), ([1.0; 3], vec![vec![0, 1, 2], vec![1, 2, 3]]));
        assert_eq!(mesh.lines, [7, 10]);
        let message = parse(&format!("{POINTS}f 1 2 \\\n3\nf 1 \\\n2 \\\nx\n")).unwrap_err();
        assert!(message.starts_with("shirt.obj:6: 'x'"), "{message}");
        // Comments end where their lines do, and the file where it does.
        let mesh = parse(&format!("# C:\\coats\\\n{POINTS}f 1 2 3\\\n")).unwrap();
        assert_eq!((mesh.positions.len(), mesh.lines), (3, vec![5]));
    }

    #[test]
    fn lines_may_end_as_on_any_system() {
        let text = format!("{POINTS}\nf 1 2 3\nf 1 2 9\n");
        for end in ["\n", "\r", "\r\n"] {
            let message = parse(&text.replace('\n', end)).unwrap_err();
            assert!(message.starts_with("shirt.obj:6: face names vertex 9"), "{end:?}: {message}");
        }
    }

    #[test]
    fn only_what_needs_it_changes() {
        let plain = b"# caf\xe9 \\ x\r\n\nv 1 2 3\r\nmtllib a\\b.mtl\nf 1 1 1";
        let one_per_line = |bytes: &[u8]| rewritten(bytes, |_, _| false);
        assert_eq!(one_per_line(plain), plain);
        assert_eq!(one_per_line(b"\xef\xbb\xbfv 1 \\\r\n2 3\rf 1\\\n 1 1\r"), b"v 1  2 3\nf 1  1 1\n");
        assert_eq!(one_per_line(b""), b"");
    }
}
