//! Poses a body as this library does it, for comparison with other implementations (`scripts/check_skinning.py`).
//!
//! ```text
//! pose_body BODY.npz INPUT.npz OUT.npz
//! ```
//! INPUT holds `betas` `[n, K]` and `poses` `[n, J, 3]` (axis-angle, radians); OUT gets `vertices` `[n, V, 3]` and
//! `joints` `[n, J, 3]` in f64, metres, with the pelvis at the origin.

use clothcombo_data::asset::{Body, BodyFileSettings, Pose};
use clothcombo_data::format::{NpzFile, NpzWriter};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [body, input, out] = &arguments[..] else {
        return Err("usage: pose_body BODY.npz INPUT.npz OUT.npz".into());
    };
    let body = Body::load(Path::new(body), &BodyFileSettings { shape_components: usize::MAX })?;
    let mut file = NpzFile::open(Path::new(input))?;
    let (betas, poses) = (file.numbers("betas", "[n, K]")?, file.numbers("poses", "[n, J, 3]")?);
    let (&[count, shape_numbers], &[same, joints, 3]) = (&betas.shape[..], &poses.shape[..]) else {
        return Err("betas must be [n, K] and poses [n, J, 3]".into());
    };
    if count != same || shape_numbers == 0 || joints == 0 {
        return Err(format!("{count} rows of betas, {same} of poses").into());
    }
    let (mut vertices, mut places) = (Vec::new(), Vec::new());
    for (beta, pose) in betas.data.chunks_exact(shape_numbers).zip(poses.data.chunks_exact(3 * joints)) {
        let pose = Pose { rotations: pose.chunks_exact(3).map(|r| [r[0], r[1], r[2]]).collect() };
        let posed = body.posed(beta, &pose)?;
        vertices.extend_from_slice(posed.positions.as_flattened());
        places.extend_from_slice(posed.joints.as_flattened());
    }
    let mut npz = NpzWriter::new();
    npz.f64("vertices", &[count, body.vertex_count(), 3], &vertices);
    npz.f64("joints", &[count, body.joint_count(), 3], &places);
    Ok(npz.save(Path::new(out))?)
}
