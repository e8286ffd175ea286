//! glTF 2.0, JSON (`.gltf`) and binary (`.glb`): the triangles of the default scene, merged, with their node transforms.
//!
//! Own reader of the few parts a mesh needs, so that every accessor is checked against its buffer before it is followed.
//! Materials, animations and morph targets are read over; a skinned mesh is taken as its vertices are written. Sparse and
//! compressed accessors are refused by name.

mod buffers;
mod document;
mod write;

pub use write::{SceneMesh, encode_glb, save_glb};

use super::polygon_mesh::{PolygonMesh, check_count};
use buffers::Buffers;
use document::{Document, Node, Primitive};
use std::collections::HashMap;
use std::path::Path;

type Affine = [[f64; 4]; 3];

const IDENTITY: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Extensions that change how positions are stored.
const COMPRESSIONS: [&str; 4] = [
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_mesh_quantization",
];

/// Reads a glTF file; external buffers lie in the folder of `path`.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<PolygonMesh, String> {
    let (json, chunk) = if bytes.starts_with(b"glTF") { binary_chunks(bytes)? } else { (bytes, None) };
    let document: Document = serde_json::from_slice(json).map_err(|e| format!("glTF JSON: {e}"))?;
    if let Some(name) = document.extensions_required.iter().find(|e| COMPRESSIONS.contains(&e.as_str())) {
        return Err(format!("needs the extension {name}; export it without mesh compression"));
    }
    let mut buffers = Buffers::new(&document, chunk, path.parent().unwrap_or(Path::new("")));
    let mut mesh = PolygonMesh::default();
    for (mesh_index, place) in placed_meshes(&document)? {
        let source = document
            .meshes
            .get(mesh_index)
            .ok_or_else(|| format!("a node names mesh {mesh_index} of {}", document.meshes.len()))?;
        // Primitives of one mesh often share their vertices: first vertex and number of those of an accessor.
        let mut vertices: HashMap<usize, (u32, u32)> = HashMap::new();
        for (number, primitive) in source.primitives.iter().enumerate() {
            add_primitive(primitive, &document, &mut buffers, &place, &mut vertices, &mut mesh)
                .map_err(|message| format!("mesh {mesh_index}, primitive {number}: {message}"))?;
        }
    }
    Ok(mesh)
}

/// JSON and binary chunk of a `.glb`.
fn binary_chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let word = |at: usize| {
        let raw = bytes.get(at..at + 4).ok_or("the file ends in a header (truncated?)")?;
        Ok::<usize, String>(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]) as usize)
    };
    let version = word(4)?;
    if version != 2 {
        return Err(format!("glTF version {version}; only version 2 is known"));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < bytes.len() {
        let (length, kind) = (word(at)?, word(at + 4)?);
        let data = bytes.get(at + 8..at + 8 + length).ok_or_else(|| {
            format!(
                "a chunk of {length} bytes, but only {} are left (truncated?)",
                bytes.len().saturating_sub(at + 8)
            )
        })?;
        match kind {
            0x4E4F_534A if json.is_none() => json = Some(data),
            0x004E_4942 if binary.is_none() => binary = Some(data),
            _ => {}
        }
        at += 8 + length;
    }
    Ok((json.ok_or("a .glb without its JSON chunk")?, binary))
}

/// The meshes of the default scene with their world transforms; without scenes those of all root nodes, without nodes all.
fn placed_meshes(document: &Document) -> Result<Vec<(usize, Affine)>, String> {
    let nodes = &document.nodes;
    if nodes.is_empty() {
        return Ok((0..document.meshes.len()).map(|m| (m, IDENTITY)).collect());
    }
    let roots: Vec<usize> = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let mut is_child = vec![false; nodes.len()];
            for child in nodes.iter().flat_map(|n| &n.children) {
                if let Some(slot) = is_child.get_mut(*child) {
                    *slot = true;
                }
            }
            (0..nodes.len()).filter(|n| !is_child[*n]).collect()
        }
    };
    let mut visited = vec![false; nodes.len()];
    let mut placed = Vec::new();
    let mut stack: Vec<(usize, Affine)> = roots.iter().rev().map(|n| (*n, IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
        let node = nodes.get(index).ok_or_else(|| format!("node {index} of {} is named", nodes.len()))?;
        if std::mem::replace(&mut visited[index], true) {
            return Err(format!("node {index} is reached twice; nodes must form a tree"));
        }
        let world = product(&parent, &local_transform(node));
        if let Some(mesh) = node.mesh {
            // The specification: the node transform of a skinned mesh is ignored.
            placed.push((mesh, if node.skin.is_some() { IDENTITY } else { world }));
        }
        stack.extend(node.children.iter().rev().map(|c| (*c, world)));
    }
    Ok(placed)
}

fn local_transform(node: &Node) -> Affine {
    if let Some(m) = node.matrix {
        // Stored by columns.
        return std::array::from_fn(|r| std::array::from_fn(|c| m[4 * c + r]));
    }
    let [x, y, z, w] = node.rotation;
    let r = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ];
    let (s, t) = (node.scale, node.translation);
    std::array::from_fn(|a| [r[a][0] * s[0], r[a][1] * s[1], r[a][2] * s[2], t[a]])
}

fn product(a: &Affine, b: &Affine) -> Affine {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let linear: f64 = (0..3).map(|k| a[r][k] * b[k][c]).sum();
            if c == 3 { linear + a[r][3] } else { linear }
        })
    })
}

fn transform(m: &Affine, p: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
}

fn is_mirrored(m: &Affine) -> bool {
    let [a, b, c] = m;
    let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0]);
    determinant < 0.0
}

fn add_primitive(
    primitive: &Primitive,
    document: &Document,
    buffers: &mut Buffers,
    place: &Affine,
    vertices: &mut HashMap<usize, (u32, u32)>,
    mesh: &mut PolygonMesh,
) -> Result<(), String> {
    let mode = primitive.mode.unwrap_or(4);
    if mode < 4 {
        // Points and lines are no surface.
        return Ok(());
    }
    let accessor = *primitive.attributes.get("POSITION").ok_or("no attribute POSITION")?;
    let (base, count) = match vertices.get(&accessor) {
        Some(known) => *known,
        None => {
            let base = mesh.positions.len();
            let positions = buffers.positions(document, accessor)?;
            check_count("vertices", base + positions.len())?;
            let own = (base as u32, positions.len() as u32);
            let texture = primitive.attributes.get("TEXCOORD_0");
            // Coordinates that cannot be read are no reason to refuse a mesh.
            let texture = texture.and_then(|accessor| buffers.texture(document, *accessor, positions.len()));
            match texture {
                Some(texture) => {
                    mesh.texture.resize(base, [0.0; 2]);
                    // v counts from the upper edge here.
                    mesh.texture.extend(texture.into_iter().map(|[u, v]| [u, 1.0 - v]));
                }
                None if !mesh.texture.is_empty() => mesh.texture.resize(base + positions.len(), [0.0; 2]),
                None => {}
            }
            mesh.positions.extend(positions.into_iter().map(|p| transform(place, p)));
            vertices.insert(accessor, own);
            own
        }
    };
    let indices: Vec<u32> = match primitive.indices {
        Some(accessor) => buffers.indices(document, accessor)?,
        None => (0..document.accessors[accessor].count as u32).collect(),
    };
    if let Some(index) = indices.iter().find(|i| **i >= count) {
        return Err(format!("names vertex {index}, but has {count} vertices"));
    }
    let triangles: Vec<[u32; 3]> = match mode {
        4 if !indices.len().is_multiple_of(3) => {
            return Err(format!("{} indices do not make whole triangles", indices.len()));
        }
        4 => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        // Strips repeat vertices to jump from one row to the next; those triangles are not meant to be there.
        5 => (indices.windows(3).enumerate())
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2])
            .collect(),
        6 => (indices.get(1..).unwrap_or_default().windows(2)).map(|w| [indices[0], w[0], w[1]]).collect(),
        other => return Err(format!("unknown primitive mode {other}")),
    };
    check_count("faces", mesh.polygon_count() + triangles.len())?;
    let turned = is_mirrored(place);
    for [a, b, c] in triangles {
        let t = [a + base, b + base, c + base];
        mesh.push(&if turned { [t[0], t[2], t[1]] } else { t });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
