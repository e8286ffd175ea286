//! A garment's own OBJ file after repairs: its statements in their order, with other vertices and faces.

use super::super::file_face::FileFace;
use super::moved::{MovedObj, behind_coordinates, with_materials};
use super::statements::{rewritten, statements};
use super::texture::texture_of;
use std::io::Write as _;
use std::path::Path;

/// What became of a file.
#[derive(Clone, Copy, Debug)]
pub struct RepairedForm<'a> {
    /// Vertices (m).
    pub positions: &'a [[f64; 3]],
    /// For each vertex the vertex of the file it came of, ascending.
    pub vertex_origin: &'a [u32],
    /// Faces, ascending by the file's face.
    pub faces: &'a [FileFace],
}

impl MovedObj {
    /// The file of `bytes`, read from `path`, as repairs left it, to be written as `NAME.obj` and `NAME.mtl`. Texture
    /// coordinates, groups, materials and the colours of vertices stay; faces and vertices that were dropped are left
    /// out, with lines and points if any was; a face that was cut becomes several, in the same place; normals are left
    /// out.
    ///
    /// # Errors
    /// Numbers of vertices and faces in the file, if it has fewer than `form` speaks of.
    pub fn repaired(path: &Path, bytes: &[u8], form: &RepairedForm, name: &str) -> Result<Self, [usize; 2]> {
        let (mut vertices, mut faces, mut texture) = (0u32, 0u32, 0i64);
        let (mut next_vertex, mut next_face) = (0, 0);
        let vertex_count = statements(bytes).filter(|s| s.words().next() == Some(b"v")).count() as u32;
        let keeps_numbers = form.vertex_origin.iter().copied().eq(0..vertex_count);
        let out = rewritten(bytes, |statement, out| {
            let mut words = statement.words();
            match words.next() {
                Some(b"v") => {
                    let rest = behind_coordinates(&statement.text);
                    while form.vertex_origin.get(next_vertex) == Some(&vertices) {
                        let [x, y, z] = form.positions[next_vertex];
                        // Writing to memory cannot fail.
                        let _ = write!(out, "v {x:.7} {y:.7} {z:.7}");
                        out.extend_from_slice(rest);
                        out.push(b'\n');
                        next_vertex += 1;
                    }
                    vertices += 1;
                }
                Some(b"f") => {
                    let corners: Vec<&[u8]> = words.take_while(|word| !word.starts_with(b"#")).collect();
                    let textures: Vec<Option<i64>> =
                        corners.iter().map(|word| texture_of(word, texture)).collect();
                    while let Some(face) = form.faces.get(next_face).filter(|face| face.face == faces) {
                        out.push(b'f');
                        for [vertex, corner] in &face.corners {
                            let _ = write!(out, " {}", vertex + 1);
                            if let Some(number) = textures.get(*corner as usize).copied().flatten() {
                                let _ = write!(out, "/{number}");
                            }
                        }
                        out.push(b'\n');
                        next_face += 1;
                    }
                    faces += 1;
                }
                Some(b"vn") => {}
                Some(b"l" | b"p") if !keeps_numbers => {}
                Some(b"vt") => {
                    texture += 1;
                    return false;
                }
                _ => return false,
            }
            true
        });
        if next_vertex < form.positions.len() || next_face < form.faces.len() {
            return Err([vertices as usize, faces as usize]);
        }
        Ok(with_materials(&out, path.parent().unwrap_or(Path::new("")), name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# skirt\r\nmtllib gone.mtl\nv 0 0 0 1 0 0 # red\nv 9 9 9\nv 1 0 0\nvt 0 0\nvt 1 0\nvt 1 1\n\
        vn 0 0 1\ng front\nusemtl wool\nf 1/1/1 3/2/1 4/-1/1 5//1\nl 1 3\nv 1 1 0\nv 0 1 0\ng back\nf 4 3 1 # seam\n";

    fn repaired(form: &RepairedForm) -> Result<String, [usize; 2]> {
        MovedObj::repaired(Path::new("skirt.obj"), TEXT.as_bytes(), form, "skirt")
            .map(|moved| String::from_utf8(moved.obj).unwrap())
    }

    fn face(face: u32, corners: &[[u32; 2]]) -> FileFace {
        FileFace { face, corners: corners.to_vec() }
    }

    #[test]
    fn what_was_repaired_changes_and_the_rest_stays_in_its_place() {
        let positions = [[0.5; 3], [1.5; 3], [2.5; 3], [3.5; 3], [4.5; 3]];
        let faces = [
            face(0, &[[0, 0], [1, 1], [2, 2]]),
            face(0, &[[0, 0], [2, 2], [4, 3]]),
            face(1, &[[0, 2], [1, 1], [3, 0]]),
        ];
        let form = RepairedForm { positions: &positions, vertex_origin: &[0, 2, 3, 3, 4], faces: &faces };
        let expected = "# skirt\r\n# not found: mtllib gone.mtl\nv 0.5000000 0.5000000 0.5000000 1 0 0 # red\n\
            v 1.5000000 1.5000000 1.5000000\nvt 0 0\nvt 1 0\nvt 1 1\ng front\nusemtl wool\n\
            f 1/1 2/2 3/3\nf 1/1 3/3 5\n\
            v 2.5000000 2.5000000 2.5000000\nv 3.5000000 3.5000000 3.5000000\nv 4.5000000 4.5000000 4.5000000\n\
            g back\nf 1 2 4\n";
        assert_eq!(repaired(&form).unwrap(), expected);
        let missing = RepairedForm { vertex_origin: &[0, 2, 3, 3, 9], ..form };
        assert_eq!(repaired(&missing), Err([5, 2]));
    }

    #[test]
    fn a_file_without_defects_keeps_its_faces() {
        let positions = [[0.0; 3]; 5];
        let faces = [face(0, &[[0, 0], [2, 1], [3, 2], [4, 3]]), face(1, &[[3, 0], [2, 1], [0, 2]])];
        let form = RepairedForm { positions: &positions, vertex_origin: &[0, 1, 2, 3, 4], faces: &faces };
        let text = repaired(&form).unwrap();
        assert!(text.contains("\nf 1/1 3/2 4/3 5\nl 1 3\n") && text.ends_with("f 4 3 1\n"), "{text}");
    }
}
