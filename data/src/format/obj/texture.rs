//! Texture coordinates in an OBJ file.

use super::statements::statements;
use std::collections::HashMap;

/// Number of the texture coordinates in `12/3`, from 1; negative ones count back from the `so_far` that were there before.
pub(super) fn texture_of(word: &[u8], so_far: i64) -> Option<i64> {
    let part = word.split(|b| *b == b'/').nth(1)?;
    let number: i64 = std::str::from_utf8(part).ok()?.parse().ok()?;
    let number = if number < 0 { so_far.checked_add(number)?.checked_add(1)? } else { number };
    (number > 0).then_some(number)
}

/// Texture coordinates (u to the right, v upwards) of the corners of `triangles`, of which each is a part of a face of the OBJ file of
/// `bytes`; `vertices` says which vertex of the triangles every vertex of the file is. `None` where a corner has no coordinates, or a
/// triangle is no part of a face.
pub fn texture_of_triangles(
    bytes: &[u8],
    vertices: &[u32],
    triangles: &[[u32; 3]],
) -> Option<Vec<[[f32; 2]; 3]>> {
    let faces = textured_faces(bytes, vertices)?;
    let mut faces_of_vertex: HashMap<u32, Vec<usize>> = HashMap::new();
    for (number, face) in faces.iter().enumerate() {
        face.iter().for_each(|(vertex, _)| faces_of_vertex.entry(*vertex).or_default().push(number));
    }
    let of_triangle = |triangle: &[u32; 3]| {
        let at = |face: &Face, vertex: u32| {
            face.iter().find(|(other, _)| *other == vertex).map(|(_, texture)| *texture)
        };
        let candidates = faces_of_vertex.get(&triangle[0])?;
        candidates.iter().find_map(|&number| {
            let face = &faces[number];
            Some([at(face, triangle[0])?, at(face, triangle[1])?, at(face, triangle[2])?])
        })
    };
    triangles.iter().map(of_triangle).collect()
}

/// Vertex and texture coordinates of every corner.
type Face = Vec<(u32, [f32; 2])>;

fn textured_faces(bytes: &[u8], vertices: &[u32]) -> Option<Vec<Face>> {
    let (mut vertex_count, mut texture) = (0_i64, Vec::new());
    let mut faces: Vec<Vec<(i64, i64)>> = Vec::new();
    for statement in statements(bytes) {
        let mut words = statement.words();
        match words.next() {
            Some(b"v") => vertex_count += 1,
            Some(b"vt") => {
                let mut number = || std::str::from_utf8(words.next()?).ok()?.parse::<f32>().ok();
                // A coordinate along a line has no v.
                texture.push([number()?, number().unwrap_or(0.0)]);
            }
            Some(b"f") => {
                let corner = |word: &[u8]| {
                    let vertex = word.split(|b| *b == b'/').next()?;
                    let vertex: i64 = std::str::from_utf8(vertex).ok()?.parse().ok()?;
                    let vertex = if vertex < 0 { vertex_count.checked_add(vertex)? } else { vertex - 1 };
                    Some((vertex, texture_of(word, texture.len() as i64)? - 1))
                };
                faces.push(
                    words.take_while(|word| !word.starts_with(b"#")).map(corner).collect::<Option<_>>()?,
                );
            }
            _ => {}
        }
    }
    // Faces may come before what they name.
    let found = |(vertex, number): (i64, i64)| {
        let uv = texture.get(usize::try_from(number).ok()?).filter(|uv| uv.iter().all(|x| x.is_finite()))?;
        Some((*vertices.get(usize::try_from(vertex).ok()?)?, *uv))
    };
    faces.into_iter().map(|face| face.into_iter().map(found).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two faces with a seam between them: the diagonal has other coordinates on either side.
    const SEAM: &[u8] =
        b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0.6 0 0\nvt 1 1\nvt 0.6 1\n\
        f 1/1 2/2 3/3\nf 1/4/7 3/5/7 -1/-1/7 # back\n";

    #[test]
    fn corners_read_the_coordinates_of_their_own_face() {
        let expected = [[[0.6, 0.0], [1.0, 1.0], [0.6, 1.0]], [[0.5, 0.0], [0.5, 1.0], [0.0, 0.0]]];
        let found = texture_of_triangles(SEAM, &[0, 1, 2, 3], &[[0, 2, 3], [1, 2, 0]]);
        assert_eq!(found.unwrap(), expected);
        // In another order.
        let found = texture_of_triangles(SEAM, &[3, 2, 1, 0], &[[3, 1, 0], [2, 1, 3]]);
        assert_eq!(found.unwrap(), expected);
    }

    #[test]
    fn what_is_no_part_of_a_face_or_has_no_coordinates_has_no_texture() {
        assert_eq!(texture_of_triangles(SEAM, &[0, 1, 2, 3], &[[0, 1, 3]]), None);
        assert_eq!(texture_of_triangles(SEAM, &[0, 1, 2], &[[0, 1, 2]]), None);
        for text in [
            "v 0 0 0\nf 1 1 1\n",
            "v 0 0 0\nvt 0 0\nf 1/1 1/2 1/1\n",
            "vt x\n",
            "vt 0 0\nv 0 0 0\nf 1/1 1/-2 1/1\n",
        ] {
            assert_eq!(texture_of_triangles(text.as_bytes(), &[0], &[[0, 0, 0]]), None, "{text}");
        }
    }
}
