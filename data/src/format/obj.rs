//! Wavefront OBJ: vertices, polygons and groups; texture coordinates, normals and materials are read over.
//!
//! Own parser, because a message must name the line: the usual libraries report neither it nor the offending index.

mod moved;
mod repaired;
mod statements;
mod texture;

pub use moved::MovedObj;
pub use repaired::RepairedForm;
pub use texture::texture_of_triangles;

use super::atomic;
use super::error::FileError;
use super::file_face::FileFace;
use super::polygon_mesh::{NO_FACES, PolygonMesh, check_count, read_limited};
use crate::mesh::fan;
use clothcombo_physics::mesh::TriMesh;
use statements::{Statement, statements};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

/// An OBJ file: positions as written, polygons with three or more corners, and the group each polygon is in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjMesh {
    /// Vertex positions.
    pub positions: Vec<[f64; 3]>,
    /// Corners of each polygon, 0-based.
    pub polygons: Vec<Vec<u32>>,
    /// Names of all groups in order of first appearance; the first is the unnamed one before any `g` line.
    pub groups: Vec<String>,
    /// Group of each polygon.
    pub group_of_polygon: Vec<u32>,
    /// First line of each polygon, from 1.
    pub lines: Vec<u32>,
}

impl ObjMesh {
    /// Parses OBJ text; `path` is for messages only. A face may name one vertex twice.
    ///
    /// # Errors
    /// [`FileError`] naming file and line.
    pub fn parse(text: &str, path: &Path) -> Result<Self, FileError> {
        Self::parse_bytes(text.as_bytes(), path)
    }

    /// As [`Self::parse`]. Names and comments may be in any encoding; numbers are ASCII.
    pub(super) fn parse_bytes(bytes: &[u8], path: &Path) -> Result<Self, FileError> {
        if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
            return Err(FileError::content(path)("UTF-16 text; save it as UTF-8 or ASCII"));
        }
        let mut mesh = Self { groups: vec![String::new()], ..Self::default() };
        let mut group = 0;
        let mut number_of_group = HashMap::from([(String::new(), 0)]);
        for Statement { line, text, .. } in statements(bytes) {
            let text = String::from_utf8_lossy(&text);
            let mut words = without_comment(&text).split_ascii_whitespace();
            let wrong = FileError::line(path, line);
            match words.next() {
                Some("v") => {
                    check_count("vertices", mesh.positions.len() + 1).map_err(&wrong)?;
                    mesh.positions.push(vertex(words).map_err(&wrong)?);
                }
                Some("f") => {
                    check_count("faces", mesh.polygons.len() + 1).map_err(&wrong)?;
                    let polygon: Result<Vec<u32>, String> =
                        words.map(|word| corner(word, mesh.positions.len())).collect();
                    let polygon = polygon.map_err(&wrong)?;
                    if polygon.len() < 3 {
                        let count = polygon.len();
                        return Err(wrong(format!("a face needs at least 3 corners, this one has {count}")));
                    }
                    mesh.polygons.push(polygon);
                    mesh.group_of_polygon.push(group);
                    mesh.lines.push(line as u32);
                }
                Some("g") => {
                    let name = words.collect::<Vec<_>>().join(" ");
                    group = *number_of_group.entry(name).or_insert_with_key(|name| {
                        mesh.groups.push(name.clone());
                        mesh.groups.len() as u32 - 1
                    });
                }
                _ => {}
            }
        }
        // Faces may come before their vertices, so the range is checked at the end.
        let count = mesh.positions.len();
        for (polygon, line) in mesh.polygons.iter().zip(&mesh.lines) {
            if let Some(index) = polygon.iter().find(|i| **i as usize >= count) {
                let index = u64::from(*index) + 1;
                let message = format!("face names vertex {index}, but the file has {count} vertices");
                return Err(FileError::line(path, *line as usize)(message));
            }
        }
        if mesh.polygons.is_empty() {
            return Err(FileError::content(path)(NO_FACES));
        }
        Ok(mesh)
    }

    /// Polygons as triangle fans from their first corner.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.polygons.iter().flat_map(|p| fan(p, 0)).collect()
    }

    /// The triangles of one group.
    pub fn group_triangles(&self, group: &str) -> Vec<[u32; 3]> {
        let Some(index) = self.groups.iter().position(|g| g == group) else { return Vec::new() };
        let of_group =
            self.polygons.iter().zip(&self.group_of_polygon).filter(|(_, g)| **g as usize == index);
        of_group.flat_map(|(p, _)| fan(p, 0)).collect()
    }

    /// The vertices of one group, ascending, each once.
    pub fn group_vertices(&self, group: &str) -> Vec<u32> {
        let mut vertices = self.group_triangles(group).concat();
        vertices.sort_unstable();
        vertices.dedup();
        vertices
    }

    /// Positions and polygons without the groups.
    pub fn into_polygon_mesh(self) -> PolygonMesh {
        let mut mesh = PolygonMesh::with_positions(self.positions);
        mesh.lines = self.lines;
        self.polygons.iter().for_each(|p| mesh.push(p));
        mesh
    }
}

/// How programs of Microsoft's C library write what is no number, after its dot.
const NO_NUMBERS: [&str; 5] = ["#IND", "#QNAN", "#SNAN", "#INF", "#J"];

/// A statement without the comment behind it; the `#` of `-1.#IND` is part of a number.
fn without_comment(text: &str) -> &str {
    let is_comment = |(at, _): &(usize, &str)| {
        let (before, after) = text.split_at(*at);
        !(before.ends_with("1.") && NO_NUMBERS.iter().any(|kind| after.starts_with(kind)))
    };
    text.match_indices('#').find(is_comment).map_or(text, |(at, _)| &text[..at])
}

fn vertex<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], String> {
    let mut position = [0.0f64; 3];
    for (axis, x) in position.iter_mut().enumerate() {
        let word =
            words.next().ok_or_else(|| format!("a vertex needs 3 coordinates, this one has {axis}"))?;
        *x = match word.contains('#') {
            true => f64::NAN,
            false => word.parse().map_err(|_| format!("'{word}' is not a number"))?,
        };
        if !x.is_finite() {
            return Err(format!("vertex coordinate '{word}' is not finite"));
        }
    }
    Ok(position)
}

/// `12`, `12/3`, `12//4` or `-1` as a 0-based vertex index.
fn corner(word: &str, vertices_so_far: usize) -> Result<u32, String> {
    let number = word.split('/').next().unwrap_or_default();
    let index: i64 = number.parse().map_err(|_| format!("'{word}' is not a face corner"))?;
    let zero_based = match index {
        0 => return Err("face names vertex 0, but OBJ counts from 1".into()),
        i if i < 0 => i.checked_add(vertices_so_far as i64).unwrap_or(-1),
        i => i - 1,
    };
    u32::try_from(zero_based).map_err(|_| {
        format!("face names vertex {index}, but there are {vertices_so_far} vertices before this line")
    })
}

/// Reads an OBJ file as a triangle mesh.
///
/// # Errors
/// [`FileError`] naming file and line.
pub fn load(path: &Path) -> Result<TriMesh, FileError> {
    ObjMesh::parse_bytes(&read_limited(path)?, path)?.into_polygon_mesh().to_tri_mesh(path)
}

/// Writes a mesh as OBJ, whole or not at all; `comments` become leading `#` lines. Coordinates keep 0.1 µm.
///
/// # Errors
/// If the file cannot be written.
pub fn save(
    path: &Path,
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    comments: &[String],
) -> Result<(), FileError> {
    save_polygons(path, positions, faces.iter().map(|f| f.as_slice()), comments)
}

/// As [`save`], with polygons of any number of corners (0-based).
///
/// # Errors
/// If the file cannot be written.
pub fn save_polygons<'a>(
    path: &Path,
    positions: &[[f64; 3]],
    polygons: impl IntoIterator<Item = &'a [u32]>,
    comments: &[String],
) -> Result<(), FileError> {
    let corners = |polygon: &'a [u32]| polygon.iter().map(|vertex| (*vertex, None));
    save_corners(path, positions, &[], polygons.into_iter().map(corners), comments)
}

/// As [`save`], with faces that came of a file's faces, and the texture coordinates that belong to that file's
/// vertices, if it has any. `polygons` are the file's, corners 0-based.
///
/// # Errors
/// If the file cannot be written.
pub fn save_file_faces(
    path: &Path,
    positions: &[[f64; 3]],
    faces: &[FileFace],
    file: &PolygonMesh,
    comments: &[String],
) -> Result<(), FileError> {
    let polygons: Vec<&[u32]> = file.polygons().collect();
    let corners = |face: &FileFace| {
        let polygon = polygons.get(face.face as usize).copied().unwrap_or_default();
        let texture = |corner: u32| polygon.get(corner as usize).copied();
        let known = |texture: &u32| file.texture.len() > *texture as usize;
        let corners = face.corners.iter().map(|[vertex, corner]| (*vertex, texture(*corner).filter(known)));
        corners.collect::<Vec<_>>()
    };
    save_corners(path, positions, &file.texture, faces.iter().map(corners), comments)
}

/// Writes faces of corners: vertex and, if it has any, texture coordinates, both 0-based.
fn save_corners<C: IntoIterator<Item = (u32, Option<u32>)>>(
    path: &Path,
    positions: &[[f64; 3]],
    texture: &[[f64; 2]],
    faces: impl Iterator<Item = C>,
    comments: &[String],
) -> Result<(), FileError> {
    let mut text = String::with_capacity(positions.len() * 64);
    for line in comments.iter().flat_map(|comment| comment.lines()) {
        let _ = writeln!(text, "# {line}");
    }
    for [x, y, z] in positions {
        let _ = writeln!(text, "v {x:.7} {y:.7} {z:.7}");
    }
    for [u, v] in texture {
        let _ = writeln!(text, "vt {u:.6} {v:.6}");
    }
    for face in faces {
        text.push('f');
        for (vertex, texture) in face {
            let _ = write!(text, " {}", u64::from(vertex) + 1);
            if let Some(texture) = texture {
                let _ = write!(text, "/{}", u64::from(texture) + 1);
            }
        }
        text.push('\n');
    }
    atomic::write(path, text.as_bytes()).map_err(FileError::io(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn parse(text: &str) -> Result<ObjMesh, String> {
        ObjMesh::parse(text, Path::new("shirt.obj")).map_err(|e| e.to_string())
    }

    const SQUARE: &str = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn reads_quads_groups_and_relative_indices() {
        let mesh = parse(&format!(
            "{SQUARE}g front\nf 1/1 2/2 3/3 4/4\ng back\nf -1//1 -2//1 -3//1\ng front\nf 1 2 4\n"
        ));
        let mesh = mesh.unwrap();
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3], [3, 2, 1], [0, 1, 3]]);
        assert_eq!(mesh.group_triangles("front"), [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
        assert_eq!(mesh.group_vertices("back"), [1, 2, 3]);
        assert_eq!(mesh.into_polygon_mesh().to_tri_mesh(Path::new("x")).unwrap().face_count(), 4);
    }

    #[test]
    fn names_the_line_of_each_defect() {
        let cases = [
            ("v 0 nan 0\nf 1 1 1\n", 1, "not finite"),
            (&format!("{SQUARE}v 0 inf 0\n"), 6, "not finite"),
            (&format!("{SQUARE}v 0 -1.#IND 0\n"), 6, "'-1.#IND' is not finite"),
            (&format!("{SQUARE}v 0 0 1.#QNAN0 # none\n"), 6, "'1.#QNAN0' is not finite"),
            (&format!("{SQUARE}v 1 2\n"), 6, "3 coordinates"),
            (&format!("{SQUARE}v 1 2. #IND\n"), 6, "3 coordinates"),
            (&format!("{SQUARE}v 1 2 x\n"), 6, "'x' is not a number"),
            (&format!("{SQUARE}\nf 1 2 9\n"), 7, "vertex 9, but the file has 4"),
            (&format!("{SQUARE}f 1 2 -5\n"), 6, "vertex -5"),
            (&format!("{SQUARE}f 0 1 2\n"), 6, "counts from 1"),
            (&format!("{SQUARE}f 1 2\n"), 6, "at least 3"),
            (&format!("{SQUARE}f 1 2 99999999999999999999\n"), 6, "not a face corner"),
        ];
        for (text, line, part) in cases {
            let message = parse(text).unwrap_err();
            assert!(
                message.starts_with(&format!("shirt.obj:{line}:")) && message.contains(part),
                "{message}"
            );
        }
        assert!(parse(SQUARE).unwrap_err().contains("no faces"));
        let collapsed = parse(&format!("{SQUARE}f 1 2 3\nf 1 2 2\n")).unwrap().into_polygon_mesh();
        let message = collapsed.to_tri_mesh(Path::new("shirt.obj")).unwrap_err().to_string();
        assert!(message.starts_with("shirt.obj:7: face 2 names vertex 2 twice"), "{message}");
    }

    #[test]
    fn faces_of_a_file_keep_its_texture_coordinates() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        let mut file = PolygonMesh::with_positions(vec![[0.0; 3]; 5]);
        file.texture = vec![[0.0, 0.25], [1.0, 0.5], [1.0, 1.0], [0.5, 0.5]];
        file.push(&[4, 3, 1, 0]);
        // Its third vertex was left out.
        let faces = [FileFace { face: 0, corners: vec![[3, 0], [2, 1], [1, 2], [0, 3]] }];
        save_file_faces(&path, &[[1.0; 3]; 4], &faces, &file, &["skirt".into()]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(
            text.starts_with("# skirt\nv 1.0000000") && text.contains("vt 0.000000 0.250000\n"),
            "{text}"
        );
        assert!(text.ends_with("\nf 4 3/4 2/2 1/1\n"), "{text}");
    }

    #[test]
    fn what_is_saved_loads_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.obj");
        let positions = vec![[0.125, -1.5, 3.0], [1.0, 0.0, 0.25], [0.0, 1.0, 0.0]];
        save(&path, &positions, &[[0, 1, 2]], &["two\nlines".into()]).unwrap();
        let mesh = load(&path).unwrap();
        assert_eq!(mesh.positions(), positions);
        assert_eq!(mesh.faces(), [[0, 1, 2]]);
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }
}
