//! glTF 2.0, JSON (`.gltf`) and binary (`.glb`): the triangles of the default scene, merged, with their node transforms.
//!
//! Own reader of the few parts a mesh needs, so that every accessor is checked against its buffer before it is followed.
//! What changes the shape is applied: morph targets at their weights, then skins in the pose of their joint nodes; quantised and
//! sparse accessors are read, compressed ones refused by name. Materials and animations are read over.

mod affine;
mod buffers;
mod document;
mod seams;
mod skin;
mod write;

pub use write::{SceneMesh, encode_glb, save_glb};

use super::polygon_mesh::{PolygonMesh, check_count};
use affine::{from_columns, is_mirrored, product};
use buffers::{Buffers, DECOMPRESS};
use clothcombo_physics::transform::{IDENTITY, Transform, apply};
use document::{GltfDocument, GltfHeader, GltfNode, Primitive};
use skin::Joints;
use std::collections::HashMap;
use std::path::Path;

/// Extensions that compress meshes.
const COMPRESSIONS: [&str; 3] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Copies of a mesh, of which the document without the extension has one.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// How the names of extensions begin that do not change where a mesh is.
const HARMLESS: [&str; 8] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_mesh_quantization",
    "KHR_animation_pointer",
    "KHR_xmp",
];

/// Why a document cannot be read as it is meant: what it needs is not known.
fn unknown_extension(document: &GltfDocument) -> Option<String> {
    let required = || document.extensions_required.iter();
    if let Some(name) = required().find(|name| COMPRESSIONS.contains(&name.as_str())) {
        return Some(format!("needs the extension {name}: {DECOMPRESS}"));
    }
    if document.extensions_used.iter().chain(required()).any(|name| name == INSTANCING) {
        return Some(format!("has instances ({INSTANCING}); make them real before the export"));
    }
    let unknown = required().find(|name| HARMLESS.iter().all(|known| !name.starts_with(known)));
    unknown.map(|name| format!("needs the extension {name}, which is not known; export without it"))
}

/// Reads a glTF file; external buffers lie in the folder of `path`. Of several meshes `only` names the one that is read.
pub(super) fn parse(bytes: &[u8], path: &Path, only: Option<&str>) -> Result<PolygonMesh, String> {
    let (json, chunk) = if bytes.starts_with(b"glTF") { binary_chunks(bytes)? } else { (bytes, None) };
    // The first version has other types everywhere.
    let header: GltfHeader = serde_json::from_slice(json).map_err(|e| format!("glTF JSON: {e}"))?;
    if header.asset.version.starts_with("1.") {
        return Err(format!("glTF version {}; only version 2 is known", header.asset.version));
    }
    let document: GltfDocument = serde_json::from_slice(json).map_err(|e| format!("glTF JSON: {e}"))?;
    if let Some(why) = unknown_extension(&document) {
        return Err(why);
    }
    let mut buffers = Buffers::new(&document, chunk, path.parent().unwrap_or(Path::new("")));
    let mut mesh = PolygonMesh::default();
    let (mut placed, worlds) = placed_meshes(&document)?;
    if let (Some(name), 2..) = (only, placed.len()) {
        let count = placed.len();
        placed.retain(|mesh| mesh.is_named(name, &document));
        if placed.len() != 1 {
            return Err(format!(
                "of its {count} meshes {} are named '{name}', where one must be; export that one alone",
                placed.len()
            ));
        }
    }
    for PlacedMesh { mesh: mesh_index, node, place } in placed {
        let source = document
            .meshes
            .get(mesh_index)
            .ok_or_else(|| format!("a node names mesh {mesh_index} of {}", document.meshes.len()))?;
        let node = node.map(|node| &document.nodes[node]);
        let weights = node.and_then(|node| node.weights.as_ref()).unwrap_or(&source.weights);
        let skin = node.and_then(|node| node.skin);
        let joints = skin.map(|skin| Joints::new(&mut buffers, skin, &worlds)).transpose()?;
        let shape = Shape { weights, place: &place, joints: joints.as_ref() };
        // Primitives of one mesh often share their vertices: first vertex and number of those of an accessor.
        let mut vertices: HashMap<usize, (u32, u32)> = HashMap::new();
        for (number, primitive) in source.primitives.iter().enumerate() {
            add_primitive(primitive, &mut buffers, &shape, &mut vertices, &mut mesh)
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

/// A mesh of the scene.
struct PlacedMesh {
    mesh: usize,
    node: Option<usize>,
    place: Transform,
}

impl PlacedMesh {
    fn is_named(&self, name: &str, document: &GltfDocument) -> bool {
        let mesh = document.meshes.get(self.mesh).map(|mesh| &mesh.name);
        let node = self.node.map(|node| &document.nodes[node].name);
        mesh.into_iter().chain(node).any(|found| found.eq_ignore_ascii_case(name))
    }
}

/// The meshes of the default scene with their world transforms, and those of all nodes; without scenes those of all root nodes,
/// without nodes all.
fn placed_meshes(document: &GltfDocument) -> Result<(Vec<PlacedMesh>, Vec<Transform>), String> {
    let nodes = &document.nodes;
    let mut worlds = vec![IDENTITY; nodes.len()];
    if nodes.is_empty() {
        let all = (0..document.meshes.len()).map(|mesh| PlacedMesh { mesh, node: None, place: IDENTITY });
        return Ok((all.collect(), worlds));
    }
    let roots: Vec<usize> = match (document.scene, document.scenes.get(document.scene.unwrap_or(0))) {
        (_, Some(scene)) => scene.nodes.clone(),
        (Some(scene), None) => return Err(format!("scene {scene} of {} is named", document.scenes.len())),
        (None, None) => {
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
    let mut stack: Vec<(usize, Transform)> = roots.iter().rev().map(|n| (*n, IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
        let node = nodes.get(index).ok_or_else(|| format!("node {index} of {} is named", nodes.len()))?;
        if std::mem::replace(&mut visited[index], true) {
            return Err(format!("node {index} is reached twice; nodes must form a tree"));
        }
        let world = product(&parent, &local_transform(node));
        worlds[index] = world;
        if let Some(mesh) = node.mesh {
            // The specification: the node transform of a skinned mesh is ignored.
            let place = if node.skin.is_some() { IDENTITY } else { world };
            placed.push(PlacedMesh { mesh, node: Some(index), place });
        }
        stack.extend(node.children.iter().rev().map(|c| (*c, world)));
    }
    Ok((placed, worlds))
}

fn local_transform(node: &GltfNode) -> Transform {
    if let Some(m) = &node.matrix {
        return from_columns(m);
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

/// What happens to the vertices of a mesh.
struct Shape<'a> {
    /// Of its morph targets.
    weights: &'a [f64],
    place: &'a Transform,
    joints: Option<&'a Joints>,
}

impl Shape<'_> {
    /// The vertices of a primitive where the scene has them.
    fn positions(
        &self,
        primitive: &Primitive,
        accessor: usize,
        buffers: &mut Buffers,
    ) -> Result<Vec<[f64; 3]>, String> {
        let mut positions: Vec<[f64; 3]> = buffers.numbers(accessor)?;
        for (target, weight) in primitive.targets.iter().zip(self.weights).filter(|(_, w)| **w != 0.0) {
            let Some(moves) = target.get("POSITION") else { continue };
            let moves: Vec<[f64; 3]> = buffers.numbers(*moves)?;
            if moves.len() != positions.len() {
                return Err(format!("a morph target has {} of {} vertices", moves.len(), positions.len()));
            }
            for (p, m) in positions.iter_mut().zip(moves) {
                (0..3).for_each(|k| p[k] += weight * m[k]);
            }
        }
        if let Some(joints) = self.joints {
            joints.skin(primitive, buffers, &mut positions)?;
        }
        positions.iter_mut().for_each(|p| *p = apply(self.place, *p));
        Ok(positions)
    }
}

fn add_primitive(
    primitive: &Primitive,
    buffers: &mut Buffers,
    shape: &Shape,
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
            let positions = shape.positions(primitive, accessor, buffers)?;
            check_count("vertices", base + positions.len())?;
            let own = (base as u32, positions.len() as u32);
            let texture = primitive.attributes.get("TEXCOORD_0");
            // Coordinates that cannot be read are no reason to refuse a mesh.
            let texture = texture.and_then(|accessor| buffers.texture(*accessor, positions.len()));
            match texture {
                Some(texture) => {
                    mesh.texture.resize(base, [0.0; 2]);
                    // v counts from the upper edge here.
                    mesh.texture.extend(texture.into_iter().map(|[u, v]| [u, 1.0 - v]));
                }
                None if !mesh.texture.is_empty() => mesh.texture.resize(base + positions.len(), [0.0; 2]),
                None => {}
            }
            mesh.positions.extend(positions);
            vertices.insert(accessor, own);
            own
        }
    };
    let indices: Vec<u32> = match primitive.indices {
        Some(accessor) => buffers.indices(accessor)?,
        None => (0..buffers.document.accessors[accessor].count as u32).collect(),
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
    let turned = is_mirrored(shape.place);
    for [a, b, c] in triangles {
        let t = [a + base, b + base, c + base];
        mesh.push(&if turned { [t[0], t[2], t[1]] } else { t });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
