//! A garment's own file for where the garment is now.

use super::super::atomic;
use super::super::folder::has_extension;
use super::super::polygon_mesh::read_limited;
use super::statements::rewritten;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// Statements of a material library that name a texture, but for those that begin with `map_`.
const TEXTURES: [&str; 5] = ["bump", "disp", "decal", "refl", "norm"];

/// An OBJ file at other vertex positions, with the materials it names.
#[derive(Clone, Debug, PartialEq)]
pub struct MovedObj {
    /// The file: faces, texture coordinates, groups and colours as they were, other vertices, no normals.
    pub obj: Vec<u8>,
    /// Its material libraries in one; none where it names none that can be read.
    pub mtl: Option<Vec<u8>>,
    /// Where those were read.
    pub libraries: Vec<PathBuf>,
}

impl MovedObj {
    /// The file of `bytes`, read from `path`, at other `positions`, to be written as `NAME.obj` and `NAME.mtl`: textures are
    /// named by where they are, so that both files can be elsewhere. Lines that a backslash continues become one.
    ///
    /// # Errors
    /// The number of vertices in the file, if there are not as many `positions`.
    pub fn new(path: &Path, bytes: &[u8], positions: &[[f64; 3]], name: &str) -> Result<Self, usize> {
        let mut count = 0;
        let moved = rewritten(bytes, |statement, out| {
            let mut words = statement.words();
            match words.next() {
                Some(b"v") => {
                    if let Some([x, y, z]) = positions.get(count) {
                        // Writing to memory cannot fail. The coordinates read back to the bit.
                        let _ = write!(out, "v {x} {y} {z}");
                    }
                    count += 1;
                    out.extend_from_slice(behind_coordinates(&statement.text));
                    out.extend_from_slice(statement.new_end());
                }
                // Other positions make normals wrong; programs that read the file compute them anew.
                Some(b"vn") => {}
                Some(b"f") => {
                    out.push(b'f');
                    for word in words.take_while(|word| !word.starts_with(b"#")) {
                        let mut parts = word.split(|b| *b == b'/');
                        out.push(b' ');
                        out.extend_from_slice(parts.next().unwrap_or_default());
                        if let Some(texture) = parts.next().filter(|t| !t.is_empty()) {
                            out.push(b'/');
                            out.extend_from_slice(texture);
                        }
                    }
                    out.push(b'\n');
                }
                _ => return false,
            }
            true
        });
        if count != positions.len() {
            return Err(count);
        }
        Ok(with_materials(&moved, path.parent().unwrap_or(Path::new("")), name))
    }

    /// Writes both into `folder`, each whole or not at all.
    ///
    /// # Errors
    /// When one cannot be written.
    pub fn save(&self, folder: &Path, name: &str) -> io::Result<()> {
        if let Some(mtl) = &self.mtl {
            atomic::write(&folder.join(format!("{name}.mtl")), mtl)?;
        }
        atomic::write(&folder.join(format!("{name}.obj")), &self.obj)
    }
}

/// What a vertex has behind its third coordinate.
pub(super) fn behind_coordinates(line: &[u8]) -> &[u8] {
    let mut rest = line;
    for _ in 0..4 {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let length = rest[start..].iter().position(|b| b.is_ascii_whitespace() || *b == b'#');
        rest = &rest[start + length.unwrap_or(rest.len() - start)..];
    }
    rest
}

/// The OBJ file of `bytes`, from `folder`, with one material library instead of those it names. What cannot be read becomes a
/// comment: by its name another garment's library might be found.
pub(super) fn with_materials(bytes: &[u8], folder: &Path, name: &str) -> MovedObj {
    let (mut obj, mut mtl) = (Vec::with_capacity(bytes.len()), None::<Vec<u8>>);
    let mut libraries = Vec::new();
    for line in bytes.split_inclusive(|b| *b == b'\n') {
        let text = String::from_utf8_lossy(line);
        let names = text.trim().strip_prefix("mtllib").filter(|rest| rest.starts_with(char::is_whitespace));
        let Some(names) = names else {
            obj.extend_from_slice(line);
            continue;
        };
        let found = libraries_of(names.trim(), folder, &mut libraries);
        if found.is_empty() {
            obj.extend_from_slice(b"# not found: ");
            obj.extend_from_slice(line);
            continue;
        }
        if mtl.is_none() {
            obj.extend_from_slice(format!("mtllib {name}.mtl\n").as_bytes());
        }
        mtl.get_or_insert_default().extend(found);
    }
    MovedObj { obj, mtl, libraries }
}

/// All material libraries, seen from `folder`, that can be read of those in `names`: one name with spaces, or several.
/// Their paths are added to `paths`.
fn libraries_of(names: &str, folder: &Path, paths: &mut Vec<PathBuf>) -> Vec<u8> {
    let mut read = |name: &str| {
        let path = folder.join(portable(name));
        // Whatever else a file may name is not for a folder that is given away.
        let is_library = has_extension(&path, "mtl");
        let bytes = is_library.then(|| read_limited(&path).ok()).flatten()?;
        paths.push(path.clone());
        Some((path.parent().unwrap_or(folder).to_owned(), bytes))
    };
    let libraries = match read(names) {
        Some(one) => vec![one],
        None => names.split_whitespace().filter_map(read).collect(),
    };
    let mut all = Vec::new();
    for (place, library) in libraries {
        for line in library.split(|b| *b == b'\n') {
            match std::str::from_utf8(line).ok().and_then(|line| with_texture_found(line, [&place, folder])) {
                Some(line) => all.extend(line.into_bytes()),
                None => all.extend_from_slice(line),
            }
            all.push(b'\n');
        }
    }
    all
}

/// A line of a material library with its texture named by where it is; none if it names none that is in one of `folders`. Options
/// come before a name that may have spaces: the longest end of the line that is a file is it.
fn with_texture_found(line: &str, folders: [&Path; 2]) -> Option<String> {
    let line = line.trim_end();
    let statement = line.split_whitespace().next()?.to_ascii_lowercase();
    if !statement.starts_with("map_") && !TEXTURES.contains(&statement.as_str()) {
        return None;
    }
    let spaces = line.match_indices(char::is_whitespace).map(|(at, space)| at + space.len());
    let mut words = spaces.filter(|start| !line[*start..].starts_with(char::is_whitespace));
    words.find_map(|start| {
        let name = portable(&line[start..]);
        let paths = folders.iter().filter_map(|folder| std::path::absolute(folder.join(&name)).ok());
        let path = paths.into_iter().find(|path| path.is_file())?;
        Some(format!("{}{}", &line[..start], path.display()))
    })
}

/// A path with this system's separators: some programs write those of theirs.
fn portable(name: &str) -> String {
    name.replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::super::ObjMesh;
    use super::*;
    use std::fs;

    fn moved(text: &str, positions: &[[f64; 3]]) -> Result<String, usize> {
        let moved = MovedObj::new(Path::new("shirt.obj"), text.as_bytes(), positions, "shirt")?;
        Ok(String::from_utf8(moved.obj).unwrap())
    }

    #[test]
    fn without_normals_everything_else_stays() {
        let text = "v 0 0 0\nvn 0 0 1\nvt 0 1\nusemtl red\nf 1/1/1 2//1 -1/2 4 # seam\r\n  f 1//1 2//1 3//1";
        assert_eq!(
            moved(text, &[[0.0; 3]]).unwrap(),
            "v 0 0 0\nvt 0 1\nusemtl red\nf 1/1 2 -1/2 4\nf 1 2 3\n"
        );
    }

    #[test]
    fn other_positions_leave_the_rest_of_the_file_alone() {
        let text =
            "# one\r\n  v 1 2 3 0.5 0.5 0.5 # red\r\nvn 0 0 1\nv 4 5 6#x\nv\t7 8 9\ng a b\nf 1/1 2/2 -1/3\n";
        let positions = [[0.1, -2e-17, 3.0], [1.0 / 3.0, 0.0, 0.0], [5.0, 6.0, 7.0]];
        let new = moved(text, &positions).unwrap();
        assert!(new.contains(" 0.5 0.5 0.5 # red\r\n") && new.contains("0 0#x\n"), "{new}");
        assert!(new.ends_with("g a b\nf 1/1 2/2 -1/3\n"));
        let mesh = ObjMesh::parse(&new, Path::new("shirt.obj")).unwrap();
        assert_eq!(mesh.positions, positions);
        assert_eq!(mesh.polygons, [[0, 1, 2]]);
        assert_eq!(moved(text, &positions[1..]), Err(3));
    }

    #[test]
    fn a_mark_of_the_byte_order_continued_lines_and_old_line_ends_are_read_as_the_reader_does() {
        let positions = [[1.5, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 3.5]];
        for text in [
            "\u{feff}v 9 9 9 1 0 0\nv 9 9 9\nv 9 9 9\nf 1 2 3\n",
            "v 9 \\\n9 9 1 0 0\nv 9 9 9\nv 9 9 9\nf 1/1 \\\r\n2 \\\n 3\n",
            "v 9 9 9 1 0 0\rv 9 9 9\rv 9 9 9\rvn 0 0 1\rf 1//1 2//1 3//1\r",
        ] {
            let read = ObjMesh::parse(text, Path::new("x.obj")).unwrap();
            let moved = MovedObj::new(Path::new("x.obj"), text.as_bytes(), &positions, "x").unwrap();
            let written = String::from_utf8(moved.obj).unwrap();
            assert!(written.starts_with("v 1.5 0 0 1 0 0\nv 0 2.5 0\n"), "{written:?}");
            let again = ObjMesh::parse(&written, Path::new("x.obj")).unwrap();
            assert_eq!((again.positions.as_slice(), again.polygons), (&positions[..], read.polygons));
        }
    }

    #[test]
    fn materials_come_along_and_their_textures_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let write = |name: &str, bytes: &[u8]| {
            fs::create_dir_all(at(name).parent().unwrap()).unwrap();
            fs::write(at(name), bytes).unwrap();
        };
        write("maps/red wool.png", b"");
        write("mats/wool.png", b"");
        write("linen.png", b"");
        write("secret", b"newmtl secret\n");
        write("my cloth.mtl", b"newmtl gr\xfcn\r\nKd 1 0 0\r\nmap_Kd -s 2 2 1 maps\\red wool.png\r\n");
        write("mats/b.mtl", b"newmtl b\n\tbump  wool.png\nmap_Ka gone.png\nmap_Kd linen.png\nKd wool.png");
        let text =
            "mtllib my cloth.mtl\nv 0 0 0\nmtllib gone.mtl mats\\b.mtl secret\nusemtl b\nmtllib none.mtl\n";
        let moved = MovedObj::new(&at("coat.obj"), text.as_bytes(), &[[1.0, 2.0, 3.0]], "coat 2").unwrap();
        let expected = "mtllib coat 2.mtl\nv 1 2 3\nusemtl b\n# not found: mtllib none.mtl\n";
        assert_eq!(String::from_utf8(moved.obj.clone()).unwrap(), expected);
        let mut expected = b"newmtl gr\xfcn\r\nKd 1 0 0\r\nmap_Kd -s 2 2 1 ".to_vec();
        let textures =
            ["maps/red wool.png", "mats/wool.png", "linen.png"].map(|name| at(name).display().to_string());
        expected.extend(
            format!(
                "{}\n\nnewmtl b\n\tbump  {}\nmap_Ka gone.png\nmap_Kd {}\nKd wool.png\n",
                textures[0], textures[1], textures[2]
            )
            .bytes(),
        );
        let mtl = moved.mtl.clone().unwrap();
        assert_eq!(String::from_utf8_lossy(&mtl), String::from_utf8_lossy(&expected));
        assert_eq!(mtl, expected);

        let out = at("out");
        moved.save(&out, "coat 2").unwrap();
        assert_eq!(fs::read(out.join("coat 2.mtl")).unwrap(), mtl);
        assert_eq!(fs::read(out.join("coat 2.obj")).unwrap(), moved.obj);
    }

    #[test]
    fn without_a_library_there_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let moved = |text: &str| {
            MovedObj::new(&folder.path().join("x.obj"), text.as_bytes(), &[[0.0; 3]], "x").unwrap()
        };
        let MovedObj { obj, mtl, .. } = moved("v 0 0 0\nusemtl a\n");
        assert_eq!((obj.as_slice(), mtl), (b"v 0 0 0\nusemtl a\n".as_slice(), None));
        // A folder is no library.
        fs::create_dir(folder.path().join("a.mtl")).unwrap();
        assert_eq!(moved("mtllib a.mtl\nv 0 0 0\n").mtl, None);
    }
}
