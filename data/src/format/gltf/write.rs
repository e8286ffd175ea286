//! Writes binary glTF 2.0 (`.glb`): named, coloured meshes, still or moving.
//!
//! A motion is a morph-target animation, which needs no skeleton and is read by Blender and the common viewers: the mesh is
//! the first frame, every further frame is a morph target (its displacements and changes of normal), and a linear sampler
//! brings the weight of one target after the other to 1, so that between two frames every vertex moves on a straight line.
//!
//! Written with `serde_json`, not a glTF crate: the reader beside it has its own document of the few parts a mesh needs, and
//! the writer needs no more.

use super::seams::Seams;
use crate::format::atomic;
use crate::format::error::FileError;
use clothcombo_physics::vertex_normals;
use serde_json::{Value, json};
use std::path::Path;

/// One mesh of a scene.
#[derive(Clone, Debug)]
pub struct SceneMesh<'a> {
    /// Name of node and mesh.
    pub name: &'a str,
    /// Colour (sRGB).
    pub colour: [u8; 3],
    /// Triangles `[F, 3]`.
    pub faces: &'a [[u32; 3]],
    /// Positions `[V, 3]` (m) of every frame, at least one.
    pub frames: Vec<&'a [[f64; 3]]>,
    /// Texture coordinates (u to the right, v upwards) of the corners of every face `[F, 3, 2]`, if it has any.
    pub texture: Option<Vec<[[f32; 2]; 3]>>,
}

/// Writes [`encode_glb`] to `path`, whole or not at all.
///
/// # Errors
/// As [`encode_glb`], or when the file cannot be written.
pub fn save_glb(path: &Path, meshes: &[SceneMesh], times: &[f64]) -> Result<(), FileError> {
    let bytes = encode_glb(meshes, times).map_err(FileError::content(path))?;
    atomic::write(path, &bytes).map_err(FileError::io(path))
}

/// The bytes of a `.glb`. `times` (s), ascending, are those of the frames; a single frame needs none.
///
/// # Errors
/// The mesh that does not fit, and why.
pub fn encode_glb(meshes: &[SceneMesh], times: &[f64]) -> Result<Vec<u8>, String> {
    let frames = times.len().max(1);
    let mut file = File::default();
    // Every mesh moves by the same weights: one sampler serves all.
    let sampler = (frames > 1).then(|| file.weights(times));
    for mesh in meshes {
        check(mesh, frames)?;
        file.add(mesh, sampler.is_some());
    }
    file.finish(sampler)
}

fn check(mesh: &SceneMesh, frames: usize) -> Result<(), String> {
    let wrong = |found: String, expected: String| {
        Err(format!("mesh '{}' has {found}, expected {expected}", mesh.name))
    };
    if mesh.frames.len() != frames {
        return wrong(format!("{} frames", mesh.frames.len()), format!("{frames}"));
    }
    let vertices = mesh.frames[0].len();
    for (frame, positions) in mesh.frames.iter().enumerate() {
        if positions.len() != vertices {
            return wrong(format!("{} vertices in frame {frame}", positions.len()), format!("{vertices}"));
        }
        if let Some(vertex) = positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(format!("mesh '{}', frame {frame}: vertex {vertex} is not finite", mesh.name));
        }
    }
    if let Some(corner) = mesh.faces.iter().flatten().find(|v| **v as usize >= vertices) {
        return wrong(format!("a face with vertex {corner}"), format!("vertices below {vertices}"));
    }
    if let Some(texture) = mesh.texture.as_ref().filter(|texture| texture.len() != mesh.faces.len()) {
        return wrong(format!("texture of {} faces", texture.len()), format!("{}", mesh.faces.len()));
    }
    Ok(())
}

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
/// Buffer view targets.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

#[derive(Default)]
struct File {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    materials: Vec<Value>,
}

impl File {
    fn view(&mut self, bytes: impl IntoIterator<Item = [u8; 4]>, target: Option<u32>) -> usize {
        let start = self.binary.len();
        bytes.into_iter().for_each(|word| self.binary.extend_from_slice(&word));
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.binary.len() - start });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Numbers, `N` an item; bounds are those of the rounded values, as readers check them.
    fn floats<const N: usize>(&mut self, values: &[[f32; N]], target: Option<u32>, bounded: bool) -> usize {
        let view = self.view(values.iter().flatten().map(|x| x.to_le_bytes()), target);
        let kind = ["SCALAR", "VEC2", "VEC3"][N - 1];
        let mut accessor =
            json!({ "bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind });
        if bounded {
            let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..N).map(|a| values.iter().map(|v| v[a]).reduce(pick).unwrap_or(0.0)).collect()
            };
            accessor["min"] = json!(bound(f32::min));
            accessor["max"] = json!(bound(f32::max));
        }
        self.accessor(accessor)
    }

    fn vectors(&mut self, values: &[[f32; 3]], bounded: bool) -> usize {
        self.floats(values, Some(VERTICES), bounded)
    }

    /// Times, and at each of them the weights of all targets: that of its own frame is 1.
    fn weights(&mut self, times: &[f64]) -> [usize; 2] {
        let targets = times.len() - 1;
        let first = times[0];
        let seconds: Vec<[f32; 1]> = times.iter().map(|t| [(t - first) as f32]).collect();
        let mut weights = vec![[0.0f32]; times.len() * targets];
        for frame in 1..times.len() {
            weights[frame * targets + frame - 1] = [1.0];
        }
        [self.floats(&seconds, None, true), self.floats(&weights, None, true)]
    }

    fn add(&mut self, mesh: &SceneMesh, moves: bool) {
        let seams =
            mesh.texture.as_ref().map(|texture| Seams::new(mesh.frames[0].len(), mesh.faces, texture));
        let split = |values: Vec<[f32; 3]>| match &seams {
            Some(seams) => seams.vertex.iter().map(|v| values[*v as usize]).collect(),
            None => values,
        };
        let normals = |positions| split(normals(positions, mesh.faces));
        let narrow = |positions| split(narrow(positions));
        let base = narrow(mesh.frames[0]);
        let base_normals = normals(mesh.frames[0]);
        let position = self.vectors(&base, true);
        let normal = self.vectors(&base_normals, false);
        let mut attributes = json!({ "POSITION": position, "NORMAL": normal });
        if let Some(seams) = &seams {
            attributes["TEXCOORD_0"] = json!(self.floats(&seams.texture, Some(VERTICES), false));
        }
        let faces = seams.as_ref().map_or(mesh.faces, |seams| &seams.faces);
        let indices = self.view(faces.iter().flatten().map(|v| v.to_le_bytes()), Some(INDICES));
        let indices = self.accessor(json!({
            "bufferView": indices, "componentType": UNSIGNED_INT, "count": 3 * mesh.faces.len(), "type": "SCALAR",
        }));
        let number = self.meshes.len();
        let mut primitive = json!({
            "attributes": attributes, "indices": indices, "material": number,
        });
        let node = json!({ "name": mesh.name, "mesh": number });
        let mut document = json!({ "name": mesh.name });
        if moves {
            let targets: Vec<Value> = mesh.frames[1..]
                .iter()
                .map(|frame| {
                    let position = self.vectors(&differences(&narrow(frame), &base), true);
                    let turned = differences(&normals(frame), &base_normals);
                    json!({ "POSITION": position, "NORMAL": self.vectors(&turned, false) })
                })
                .collect();
            let names: Vec<String> = (1..mesh.frames.len()).map(|f| format!("frame {f}")).collect();
            document["weights"] = json!(vec![0.0; targets.len()]);
            document["extras"] = json!({ "targetNames": names });
            primitive["targets"] = json!(targets);
        }
        document["primitives"] = json!([primitive]);
        self.meshes.push(document);
        self.nodes.push(node);
        let [r, g, b] = mesh.colour.map(linear);
        self.materials.push(json!({
            "name": mesh.name,
            "doubleSided": true,
            "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9 },
        }));
    }

    fn finish(self, sampler: Option<[usize; 2]>) -> Result<Vec<u8>, String> {
        let count = self.nodes.len();
        let mut document = json!({
            "asset": { "version": "2.0", "generator": "ClothCombo-rs" },
            "scene": 0,
            "scenes": [{ "name": "drape", "nodes": (0..count).collect::<Vec<_>>() }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.binary.len() }],
        });
        if let Some([input, output]) = sampler {
            let channels: Vec<Value> = (0..count)
                .map(|node| json!({ "sampler": 0, "target": { "node": node, "path": "weights" } }))
                .collect();
            document["animations"] = json!([{
                "name": "motion",
                "samplers": [{ "input": input, "output": output, "interpolation": "LINEAR" }],
                "channels": channels,
            }]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.binary.len();
        // The format counts bytes in 32 bits.
        let total_word = u32::try_from(total).map_err(|_| {
            format!("the scene takes {total} bytes, a .glb holds at most 4 GiB; leave out frames")
        })?;
        let mut bytes = Vec::with_capacity(total);
        bytes.extend_from_slice(b"glTF");
        for word in [2, total_word, text.len() as u32, 0x4E4F_534A] {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
        bytes.extend_from_slice(&text);
        for word in [self.binary.len() as u32, 0x004E_4942] {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
        bytes.extend_from_slice(&self.binary);
        Ok(bytes)
    }
}

fn narrow(positions: &[[f64; 3]]) -> Vec<[f32; 3]> {
    positions.iter().map(|p| p.map(|x| x as f32)).collect()
}

fn differences(to: &[[f32; 3]], from: &[[f32; 3]]) -> Vec<[f32; 3]> {
    to.iter().zip(from).map(|(t, f)| std::array::from_fn(|a| t[a] - f[a])).collect()
}

/// Unit normals; the format allows no other length, so a vertex without one gets up.
fn normals(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let of = |n: [f64; 3]| if n == [0.0; 3] { [0.0, 1.0, 0.0] } else { n.map(|x| x as f32) };
    vertex_normals(positions, faces).into_iter().map(of).collect()
}

/// sRGB to the linear values glTF wants.
fn linear(value: u8) -> f32 {
    let v = f64::from(value) / 255.0;
    (if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::load_mesh;
    use clothcombo_physics::mesh::shapes::{grid, icosphere};

    fn words(bytes: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    fn document(bytes: &[u8]) -> (Value, &[u8]) {
        let length = words(bytes, 12) as usize;
        assert_eq!(words(bytes, 8) as usize, bytes.len());
        (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), &bytes[28 + length..])
    }

    /// The floats of accessor `number`, read by the specification's rules.
    fn floats(document: &Value, binary: &[u8], number: usize) -> Vec<f32> {
        let accessor = &document["accessors"][number];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let width = match accessor["type"].as_str().unwrap() {
            "VEC3" => 3,
            "VEC2" => 2,
            _ => 1,
        };
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        let count = accessor["count"].as_u64().unwrap() as usize * width;
        assert_eq!(view["byteLength"].as_u64().unwrap() as usize, 4 * count);
        assert_eq!(start % 4, 0);
        (0..count).map(|i| f32::from_bits(words(binary, start + 4 * i))).collect()
    }

    #[test]
    fn a_still_scene_is_read_back_with_equal_positions() {
        let (ball, sheet) = (icosphere(0.5, 2), grid(0.3, 0.2, 3, 4));
        let meshes = [
            SceneMesh {
                name: "body",
                colour: [200, 190, 180],
                faces: ball.faces(),
                frames: vec![ball.positions()],
                texture: None,
            },
            SceneMesh {
                name: "tee",
                colour: [10, 20, 200],
                faces: sheet.faces(),
                frames: vec![sheet.positions()],
                texture: None,
            },
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.glb");
        save_glb(&path, &meshes, &[]).unwrap();
        let read = load_mesh(&path).unwrap();
        let written = ball.positions().iter().chain(sheet.positions());
        assert_eq!(read.positions.len(), ball.vertex_count() + sheet.vertex_count());
        for (a, b) in read.positions.iter().flatten().zip(written.flatten()) {
            assert_eq!(*a, f64::from(*b as f32));
        }
        let shift = ball.vertex_count() as u32;
        let faces: Vec<[u32; 3]> =
            ball.faces().iter().copied().chain(sheet.faces().iter().map(|f| f.map(|v| v + shift))).collect();
        assert!(read.polygons().zip(&faces).all(|(a, b)| a == b) && read.polygon_count() == faces.len());
    }

    #[test]
    fn frames_are_targets_and_each_has_its_moment() {
        let sheet = grid(0.3, 0.2, 3, 2);
        let moved = |d: f64| sheet.positions().iter().map(|p| [p[0], p[1] + d, p[2]]).collect::<Vec<_>>();
        let frames = [moved(0.0), moved(0.25), moved(-0.5)];
        let mesh = SceneMesh {
            name: "tee",
            colour: [255, 0, 0],
            faces: sheet.faces(),
            frames: frames.iter().map(|f| f.as_slice()).collect(),
            texture: None,
        };
        let bytes =
            encode_glb(&[mesh.clone(), SceneMesh { name: "coat", ..mesh }], &[2.0, 2.5, 3.5]).unwrap();
        let (document, binary) = document(&bytes);
        assert_eq!(
            document["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"],
            json!([1.0, 0.0, 0.0, 1.0])
        );
        let animation = &document["animations"][0];
        assert_eq!(animation["channels"].as_array().unwrap().len(), 2);
        let [input, output] =
            ["input", "output"].map(|k| animation["samplers"][0][k].as_u64().unwrap() as usize);
        assert_eq!(floats(&document, binary, input), [0.0, 0.5, 1.5]);
        let weights = floats(&document, binary, output);
        assert_eq!(weights, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        for mesh in 0..2 {
            let primitive = &document["meshes"][mesh]["primitives"][0];
            let base =
                floats(&document, binary, primitive["attributes"]["POSITION"].as_u64().unwrap() as usize);
            assert_eq!(primitive["targets"].as_array().unwrap().len(), 2);
            for (frame, expected) in frames.iter().enumerate() {
                let mut positions = base.clone();
                for target in 0..2 {
                    let accessor = primitive["targets"][target]["POSITION"].as_u64().unwrap() as usize;
                    let delta = floats(&document, binary, accessor);
                    positions.iter_mut().zip(delta).for_each(|(p, d)| *p += weights[2 * frame + target] * d);
                }
                for (p, e) in positions.iter().zip(expected.iter().flatten()) {
                    assert!((f64::from(*p) - e).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn a_texture_cuts_the_mesh_along_its_seams_only() {
        let sheet = grid(0.2, 0.1, 2, 1);
        // The left half reads its own coordinates, the right half others: the two vertices between them are there twice.
        let of_corner = |half: f32, v: u32| sheet.positions()[v as usize].map(|x| x as f32 + half);
        let texture = |face: &[u32; 3]| {
            let left = face.iter().any(|v| sheet.positions()[*v as usize][0] == sheet.bounds().0[0]);
            face.map(|v| of_corner(if left { 0.0 } else { 0.5 }, v)).map(|[u, v, _]| [u, v])
        };
        let texture: Vec<_> = sheet.faces().iter().map(texture).collect();
        let mesh = SceneMesh {
            name: "tee",
            colour: [0; 3],
            faces: sheet.faces(),
            frames: vec![sheet.positions(), sheet.positions()],
            texture: Some(texture.clone()),
        };
        let bytes = encode_glb(&[mesh], &[0.0, 1.0]).unwrap();
        let (document, binary) = document(&bytes);
        let attributes = &document["meshes"][0]["primitives"][0]["attributes"];
        let read = |name: &str| floats(&document, binary, attributes[name].as_u64().unwrap() as usize);
        let (positions, coordinates) = (read("POSITION"), read("TEXCOORD_0"));
        assert_eq!((positions.len() / 3, coordinates.len() / 2), (6 + 2, 6 + 2));
        let target = &document["meshes"][0]["primitives"][0]["targets"][0]["POSITION"];
        assert_eq!(floats(&document, binary, target.as_u64().unwrap() as usize), vec![0.0; 3 * 8]);
        let indices = document["meshes"][0]["primitives"][0]["indices"].as_u64().unwrap() as usize;
        let at = document["bufferViews"]
            [document["accessors"][indices]["bufferView"].as_u64().unwrap() as usize]["byteOffset"]
            .as_u64()
            .unwrap() as usize;
        for (corner, (vertex, expected)) in
            sheet.faces().iter().flatten().zip(texture.iter().flatten()).enumerate()
        {
            let index = words(binary, at + 4 * corner) as usize;
            assert_eq!(coordinates[2 * index..2 * index + 2], [expected[0], 1.0 - expected[1]]);
            assert_eq!(
                positions[3 * index..3 * index + 3],
                sheet.positions()[*vertex as usize].map(|x| x as f32)
            );
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let sheet = grid(0.3, 0.2, 2, 2);
        let mut broken = sheet.positions().to_vec();
        broken[3][1] = f64::NAN;
        let mesh =
            |frames| SceneMesh { name: "tee", colour: [0; 3], faces: sheet.faces(), frames, texture: None };
        let whole = sheet.positions();
        let message = |mesh: SceneMesh, times: &[f64]| encode_glb(&[mesh], times).unwrap_err();
        assert!(message(mesh(vec![whole, &broken]), &[0.0, 1.0]).contains("'tee', frame 1: vertex 3"));
        assert!(message(mesh(vec![whole, &whole[1..]]), &[0.0, 1.0]).contains("8 vertices in frame 1"));
        assert!(message(mesh(vec![whole]), &[0.0, 1.0]).contains("1 frames"));
        assert!(message(mesh(vec![&whole[..4]]), &[]).contains("a face with vertex"));
    }
}
