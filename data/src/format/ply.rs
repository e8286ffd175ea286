//! PLY (Stanford polygon format): ASCII, binary little and big endian, any scalar types, polygons of any size.
//!
//! Own reader: every count of the header is checked against the bytes that follow before memory is taken for it.

use super::polygon_mesh::{PolygonMesh, check_count};
use super::scalar::Scalar;

/// A scalar type under either of its names.
fn scalar_type(name: &str) -> Option<Scalar> {
    Some(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

#[derive(Debug)]
struct Property {
    name: String,
    /// Type of the length, for a list.
    list: Option<Scalar>,
    scalar: Scalar,
}

#[derive(Debug)]
struct PlyElement {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// The values after the header, one at a time.
struct Values<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl Values<'_> {
    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn next(&mut self, scalar: Scalar) -> Result<f64, String> {
        if self.encoding == Encoding::Ascii {
            return self.next_word();
        }
        let size = scalar.bytes();
        let cell = self.bytes.get(self.at..self.at + size).ok_or("the file ends here (truncated?)")?;
        self.at += size;
        Ok(scalar.read(cell, self.encoding == Encoding::Big))
    }

    fn next_word(&mut self) -> Result<f64, String> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace());
        let start = start.ok_or("the file ends here (truncated?)")?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        let word = &rest[start..start + length.min(40)];
        let text = std::str::from_utf8(word).ok().filter(|_| length <= 40);
        text.and_then(|t| t.parse().ok())
            .ok_or_else(|| format!("'{}' is not a number", String::from_utf8_lossy(word)))
    }

    /// The length of a list: whole, not negative, and not longer than what is left.
    fn length(&mut self, list: Scalar) -> Result<usize, String> {
        let n = self.next(list)?;
        if n < 0.0 || n.fract() != 0.0 || n > self.left() as f64 {
            return Err(format!("a list of {n} values, but only {} bytes are left", self.left()));
        }
        Ok(n as usize)
    }
}

/// Reads a PLY file.
pub(super) fn parse(bytes: &[u8]) -> Result<PolygonMesh, String> {
    let (encoding, elements, start) = header(bytes)?;
    let mut values = Values { bytes, at: start, encoding };
    let mut mesh = PolygonMesh::default();
    let mut has_faces = false;
    for element in &elements {
        if element.properties.is_empty() {
            continue;
        }
        // A row takes at least this much: counts that cannot be true are found before anything is read.
        let least: usize = match encoding {
            Encoding::Ascii => element.properties.len(),
            _ => element.properties.iter().map(|p| p.list.unwrap_or(p.scalar).bytes()).sum(),
        };
        if element.count > values.left() / least {
            return Err(format!(
                "the header announces {} rows of '{}', but only {} bytes follow (truncated?)",
                element.count,
                element.name,
                values.left()
            ));
        }
        let in_row =
            |row: usize, message: String| format!("element '{}', row {}: {message}", element.name, row + 1);
        match element.name.as_str() {
            "vertex" => {
                check_count("vertices", element.count)?;
                let axis = |name| element.properties.iter().position(|p| p.name == name && p.list.is_none());
                let (Some(x), Some(y), Some(z)) = (axis("x"), axis("y"), axis("z")) else {
                    return Err("the vertices have no x, y and z".into());
                };
                mesh.positions.reserve(element.count);
                for row in 0..element.count {
                    let mut position = [0.0; 3];
                    let take = |number: usize, value: f64| {
                        if let Some(a) = [x, y, z].iter().position(|p| *p == number) {
                            position[a] = value;
                        }
                        Ok(())
                    };
                    read_row(&mut values, element, take).map_err(|m| in_row(row, m))?;
                    mesh.positions.push(position);
                }
            }
            "face" => {
                check_count("faces", element.count)?;
                let indices = element.properties.iter().position(|p| {
                    p.list.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index")
                });
                let indices = indices.ok_or("the faces have no list vertex_indices")?;
                has_faces = true;
                let mut corners = Vec::new();
                for row in 0..element.count {
                    corners.clear();
                    let take = |number: usize, value: f64| {
                        if number != indices {
                            return Ok(());
                        }
                        if !(0.0..f64::from(u32::MAX)).contains(&value) || value.fract() != 0.0 {
                            return Err(format!("{value} is no vertex number"));
                        }
                        corners.push(value as u32);
                        Ok(())
                    };
                    read_row(&mut values, element, take).map_err(|m| in_row(row, m))?;
                    mesh.push(&corners);
                }
            }
            _ => {
                for row in 0..element.count {
                    read_row(&mut values, element, |_, _| Ok(())).map_err(|m| in_row(row, m))?;
                }
            }
        }
    }
    if !has_faces && elements.iter().any(|e| e.name == "tristrips") {
        return Err("holds triangle strips instead of faces; export it with faces".into());
    }
    Ok(mesh)
}

/// Reads a row; `take` gets every value with the number of its property.
fn read_row(
    values: &mut Values,
    element: &PlyElement,
    mut take: impl FnMut(usize, f64) -> Result<(), String>,
) -> Result<(), String> {
    for (number, property) in element.properties.iter().enumerate() {
        let count = property.list.map_or(Ok(1), |list| values.length(list))?;
        for _ in 0..count {
            take(number, values.next(property.scalar)?)?;
        }
    }
    Ok(())
}

/// Encoding, elements, and where the values start.
fn header(bytes: &[u8]) -> Result<(Encoding, Vec<PlyElement>, usize), String> {
    let mut encoding = None;
    let mut elements: Vec<PlyElement> = Vec::new();
    let mut at = 0;
    for number in 1..=1000 {
        let end = bytes[at..].iter().take(1000).position(|b| *b == b'\n');
        let end = at + end.ok_or_else(|| format!("line {number}: the header has no 'end_header'"))?;
        let line = String::from_utf8_lossy(&bytes[at..end]);
        at = end + 1;
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let wrong = |message: String| format!("line {number}: {message}");
        match words[..] {
            ["ply"] if number == 1 => {}
            _ if number == 1 => return Err(wrong("a PLY file starts with 'ply'".into())),
            ["comment" | "obj_info", ..] | [] => {}
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(wrong(format!("unknown format '{name}'"))),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| wrong(format!("'{count}' is not a count")))?;
                elements.push(PlyElement { name: name.into(), count, properties: Vec::new() });
            }
            ["property", ref words @ ..] => {
                let element = elements.last_mut().ok_or_else(|| wrong("property without element".into()))?;
                let scalar = |name: &str| {
                    scalar_type(name).ok_or_else(|| wrong(format!("unknown scalar type '{name}'")))
                };
                let property = match *words {
                    ["list", list, value, name] => {
                        Property { name: name.into(), list: Some(scalar(list)?), scalar: scalar(value)? }
                    }
                    [value, name] => Property { name: name.into(), list: None, scalar: scalar(value)? },
                    _ => {
                        return Err(wrong(
                            "property is neither 'TYPE NAME' nor 'list TYPE TYPE NAME'".into(),
                        ));
                    }
                };
                element.properties.push(property);
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| wrong("the header names no format".into()))?;
                return Ok((encoding, elements, at));
            }
            _ => return Err(wrong(format!("unknown header line '{}'", line.trim()))),
        }
    }
    Err("the header has more than 1000 lines".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit square as one quad and one triangle of it, with an extra property before, between and after.
    fn binary(big: bool) -> Vec<u8> {
        let name = if big { "binary_big_endian" } else { "binary_little_endian" };
        let mut bytes = format!(
            "ply\nformat {name} 1.0\ncomment by hand\nelement vertex 4\nproperty uchar red\nproperty double x\n\
             property float y\nproperty short z\nelement face 2\nproperty list uchar ushort vertex_indices\n\
             property list int float uv\nelement edge 1\nproperty int a\nend_header\n"
        )
        .into_bytes();
        let order = |mut raw: Vec<u8>| {
            if big {
                raw.reverse();
            }
            raw
        };
        for [x, y, z] in [[0, 0, 7], [1, 0, -7], [1, 1, 300], [0, 1, 0]] {
            bytes.push(255);
            bytes.extend(order(f64::from(x).to_le_bytes().to_vec()));
            bytes.extend(order((y as f32).to_le_bytes().to_vec()));
            bytes.extend(order((z as i16).to_le_bytes().to_vec()));
        }
        for face in [&[0u16, 1, 2, 3][..], &[2, 1, 0]] {
            bytes.push(face.len() as u8);
            face.iter().for_each(|v| bytes.extend(order(v.to_le_bytes().to_vec())));
            bytes.extend(order(1i32.to_le_bytes().to_vec()));
            bytes.extend(order(0.5f32.to_le_bytes().to_vec()));
        }
        bytes.extend(5i32.to_le_bytes());
        bytes
    }

    #[test]
    fn both_byte_orders_and_ascii_give_the_same_mesh() {
        let little = parse(&binary(false)).unwrap();
        assert_eq!(little, parse(&binary(true)).unwrap());
        assert_eq!(little.positions, [[0., 0., 7.], [1., 0., -7.], [1., 1., 300.], [0., 1., 0.]]);
        assert_eq!(little.polygons().collect::<Vec<_>>(), [&[0, 1, 2, 3][..], &[2, 1, 0]]);
        let ascii = "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\n\
            property float z\r\nelement face 2\r\nproperty list uchar int vertex_index\r\nend_header\r\n\
            0 0 7\r\n1 0 -7\r\n1 1 3e2\r\n0 1 0\r\n4 0 1 2 3\r\n3 2 1 0\r\n";
        assert_eq!(little, parse(ascii.as_bytes()).unwrap());
    }

    #[test]
    fn what_is_wrong_is_named() {
        let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let huge = head.replace("vertex 3", "vertex 99999999999");
        let cases = [
            (format!("{head}0 0 0 1 0 0 0 x 0 3 0 1 2"), "element 'vertex', row 3: 'x' is not a number"),
            (format!("{head}0 0 0 1 0 0 0 1 0 3 0 1 -2"), "element 'face', row 1: -2 is no vertex number"),
            (format!("{head}0 0 0 1 0 0 0 1 0 9999 0 1 2"), "a list of 9999 values"),
            (format!("{head}0 0 0 1 0 0 0 1"), "row 3"),
            (format!("{huge}0 0 0"), "announces 99999999999 rows"),
            (head.replace("float x", "real x"), "line 4: unknown scalar type 'real'"),
            (head.replace("ascii", "text"), "line 2: unknown format 'text'"),
            (head.replace("end_header", "end"), "line 9: unknown header line 'end'"),
            (head.replace("property float z\n", "") + "0 0 0 0 0 0 0 0 0 0 0", "no x, y and z"),
        ];
        for (text, part) in cases {
            let message = parse(text.as_bytes()).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
        let whole = binary(false);
        let message = parse(&whole[..whole.len() - 20]).unwrap_err();
        assert!(message.contains("truncated"), "{message}");
    }
}
