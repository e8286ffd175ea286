//! STL (stereolithography), ASCII and binary. Triangles without shared vertices: corners at the same position become one.

use super::polygon_mesh::{PolygonMesh, check_count};
use std::collections::HashMap;

/// Bytes before the triangles of a binary file: 80 of header, 4 of count.
const STL_HEADER: usize = 84;
/// Bytes of a binary triangle: normal, three corners, attribute.
const TRIANGLE: usize = 50;

/// Whether the size of the file is the one its count announces, which only binary files manage.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|n| n > 0 && bytes.len() == STL_HEADER + TRIANGLE * n)
}

fn announced(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..STL_HEADER)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize)
}

/// Reads an STL file.
pub(super) fn parse(bytes: &[u8]) -> Result<PolygonMesh, String> {
    let text_start = bytes.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(bytes.len());
    if !is_binary(bytes) && bytes[text_start..].starts_with(b"solid") {
        return ascii(bytes);
    }
    let count = announced(bytes).ok_or_else(|| {
        format!("{} bytes are no STL: binary ones have a header of {STL_HEADER}", bytes.len())
    })?;
    // First of all: other files announce any number.
    if bytes.len() != STL_HEADER + TRIANGLE * count {
        return Err(format!(
            "announces {count} triangles, which take {} bytes, but has {} (truncated, or no STL?)",
            STL_HEADER + TRIANGLE * count,
            bytes.len()
        ));
    }
    check_count("faces", count)?;
    let mut welded = WeldedTriangles::default();
    for triangle in bytes[STL_HEADER..].chunks_exact(TRIANGLE) {
        let number = |i: usize| {
            let at = 12 + 4 * i;
            f32::from_le_bytes([triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]])
        };
        welded.push(std::array::from_fn(|c| std::array::from_fn(|a| f64::from(number(3 * c + a)))));
    }
    Ok(welded.mesh)
}

fn ascii(bytes: &[u8]) -> Result<PolygonMesh, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut welded = WeldedTriangles::default();
    let mut corners: Vec<[f64; 3]> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let wrong = |message: String| format!("line {}: {message}", number + 1);
        let mut words = line.split_ascii_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let mut position = [0.0; 3];
                for x in &mut position {
                    let word = words.next().ok_or_else(|| wrong("a vertex needs 3 coordinates".into()))?;
                    *x = word.parse().map_err(|_| wrong(format!("'{word}' is not a number")))?;
                }
                if corners.len() == 3 {
                    return Err(wrong("a facet has 3 vertices, this one has more".into()));
                }
                corners.push(position);
            }
            Some("endfacet") => {
                let triangle: [[f64; 3]; 3] = corners[..]
                    .try_into()
                    .map_err(|_| wrong(format!("a facet has 3 vertices, this one has {}", corners.len())))?;
                check_count("faces", welded.mesh.polygon_count() + 1)?;
                welded.push(triangle);
                welded.mesh.lines.push(number as u32 + 1);
                corners.clear();
            }
            Some("solid" | "facet" | "outer" | "endloop" | "endsolid") | None => {}
            Some(other) => return Err(wrong(format!("'{other}' is no STL keyword"))),
        }
    }
    if !corners.is_empty() {
        return Err("the last facet has no 'endfacet' (truncated?)".into());
    }
    Ok(welded.mesh)
}

/// Triangles whose equal corners are one vertex.
#[derive(Default)]
struct WeldedTriangles {
    mesh: PolygonMesh,
    known: HashMap<[u64; 3], u32>,
}

impl WeldedTriangles {
    fn push(&mut self, triangle: [[f64; 3]; 3]) {
        let corners = triangle.map(|p| {
            // −0 and 0 are one place.
            *self.known.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                self.mesh.positions.push(p);
                self.mesh.positions.len() as u32 - 1
            })
        });
        self.mesh.push(&corners);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[[f32; 3]; 3]; 2] =
        [[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.]], [[0., 0., -0.0], [1., 1., 0.], [0., 1., 0.]]];

    fn binary() -> Vec<u8> {
        // Exporters that write "solid" into binary headers exist.
        let mut bytes = b"solid made by hand".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2u32.to_le_bytes());
        for triangle in SQUARE {
            bytes.extend([0u8; 12]);
            triangle.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend([0u8; 2]);
        }
        bytes
    }

    #[test]
    fn ascii_and_binary_weld_to_the_same_square() {
        let mesh = parse(&binary()).unwrap();
        assert_eq!(mesh.positions.len(), 4);
        assert_eq!(mesh.polygons().collect::<Vec<_>>(), [[0, 1, 2], [0, 2, 3]]);
        let mut text = String::from("solid square\n");
        for t in SQUARE {
            text += "facet normal 0 0 1\n outer loop\n";
            t.iter().for_each(|p| text += &format!("  vertex {} {} {}\n", p[0], p[1], p[2]));
            text += " endloop\nendfacet\n";
        }
        text += "endsolid square\n";
        let ascii = parse(text.as_bytes()).unwrap();
        assert_eq!(ascii.positions, mesh.positions);
        assert_eq!(ascii.polygons().collect::<Vec<_>>(), mesh.polygons().collect::<Vec<_>>());
        assert_eq!(ascii.lines.len(), 2);
    }

    #[test]
    fn another_file_is_told_from_a_large_one() {
        let text = "# a garment\n".repeat(20);
        assert!(parse(text.as_bytes()).unwrap_err().contains("no STL?"));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let whole = binary();
        let mut no_solid = whole.clone();
        no_solid[0] = b'S';
        let mut huge = no_solid.clone();
        huge[83] = 255;
        let text = |t: &str| t.as_bytes().to_vec();
        for (bytes, part) in [
            (
                no_solid[..no_solid.len() - 1].to_vec(),
                "announces 2 triangles, which take 184 bytes, but has 183",
            ),
            (huge, "announces 4278190082 triangles"),
            (text("short"), "5 bytes are no STL"),
            (text("solid\nfacet\nvertex 0 0 x\n"), "line 3: 'x' is not a number"),
            (text("solid\nfacet\nvertex 0 0 0\nendfacet"), "line 4: a facet has 3 vertices, this one has 1"),
            (text("solid\nfacet\nvertex 0 0 0\n"), "truncated"),
            (text("solid\nfaket\n"), "line 2: 'faket'"),
        ] {
            let message = parse(&bytes).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }
}
