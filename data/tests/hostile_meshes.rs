//! Ten thousand damaged files per mesh format: no panic, no hang, no memory beyond the file's worth, always a reason.

mod hostile;

use clothcombo_data::format::parse_mesh;
use hostile::{damaged, survive};
use std::path::Path;

const POINTS: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.5]];

fn ply(encoding: &str, big: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    if encoding == "ascii" {
        bytes.extend(b"0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n4 0 1 2 3\n3 2 1 0\n");
        return bytes;
    }
    let mut word = |raw: [u8; 4]| bytes.extend(if big { [raw[3], raw[2], raw[1], raw[0]] } else { raw });
    POINTS.iter().flatten().for_each(|x| word(x.to_le_bytes()));
    for face in [&[0u32, 1, 2, 3][..], &[2, 1, 0]] {
        bytes.push(face.len() as u8);
        for v in face {
            bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
        }
    }
    bytes
}

fn stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2u32.to_le_bytes());
    for corners in [[0, 1, 2], [0, 2, 3]] {
        bytes.extend([0u8; 12]);
        corners.iter().flat_map(|c| POINTS[*c]).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

fn glb() -> Vec<u8> {
    let mut binary: Vec<u8> = POINTS.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    [0u16, 1, 2, 0, 2, 3].iter().for_each(|i| binary.extend(i.to_le_bytes()));
    let mut json = br#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[1],"scale":[2,2,2]},{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],"buffers":[{"byteLength":60}]}"#.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, chunk) in [(0x4E4F_534Au32, &json), (0x004E_4942, &binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(chunk);
    }
    bytes
}

#[test]
fn damaged_files_give_a_mesh_or_a_reason() {
    let obj = b"g a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nf 1/1 2/2 3/3 4/4\ng b\nf -4 -3 -2\n".to_vec();
    let text_stl = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\nendsolid a\n".to_vec();
    let formats: [(&str, Vec<Vec<u8>>); 4] = [
        ("x.obj", vec![obj]),
        (
            "x.ply",
            vec![ply("ascii", false), ply("binary_little_endian", false), ply("binary_big_endian", true)],
        ),
        ("x.stl", vec![stl(), text_stl]),
        ("x.glb", vec![glb()]),
    ];
    for (name, seeds) in formats {
        let read = |bytes: &[u8]| match parse_mesh(bytes, Path::new(name)) {
            Ok(_) => Ok(()),
            Err(error) => Err(error.to_string()),
        };
        // The files have a few hundred bytes.
        survive(name, &seeds, 0.2..1.0, 16 << 20, damaged, read);
    }
}
