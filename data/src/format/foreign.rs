//! Formats that are not read here, and how to get what is in them out.

use super::folder::has_extension;
use std::path::Path;

const BLENDER: &str = "open it in Blender and export";

/// Extensions, what they are, and how to export a mesh and a motion from them.
const FORMATS: [(&[&str], &str, &str, &str); 8] = [
    (
        &["fbx"],
        "an FBX scene",
        "glTF (.glb) or OBJ",
        "BVH (Blender: File > Export > Motion Capture; or from Maya or MotionBuilder)",
    ),
    (
        &["usd", "usda", "usdc", "usdz"],
        "a USD scene",
        "glTF (.glb) or OBJ; usdview and Houdini do as well",
        "BVH",
    ),
    (&["blend"], "a Blender scene", "glTF (.glb) or OBJ", "BVH (File > Export > Motion Capture)"),
    (&["dae"], "a COLLADA scene", "glTF (.glb) or OBJ", "BVH"),
    (&["abc"], "an Alembic cache", "glTF (.glb) or OBJ", "BVH, from the rig that it was baked from"),
    (
        &["ma", "mb", "max", "c4d", "zpac", "zprj"],
        "a scene of another program",
        "OBJ or glTF, from that program",
        "BVH, from that program",
    ),
    (
        &["c3d", "trc"],
        "a recording of markers, without a skeleton",
        "another file",
        "BVH, after solving it for a skeleton (Mokka, MotionBuilder), or fit SMPL to it (SOMA, MoSh++)",
    ),
    (&["asf", "amc"], "an Acclaim skeleton or motion", "another file", "`clothcombo import amc` reads it"),
];

/// Why a file of a known format that is not read is refused, and the way out; `None` for formats that nobody knows, or
/// that are read. Of pickles, too: they are programs, and never run.
pub fn way_out(path: &Path) -> Option<String> {
    if ["pkl", "pickle", "pt", "pth"].into_iter().any(|extension| has_extension(path, extension)) {
        return Some(format!(
            "a Python pickle is a program and is never executed here; these scripts take its arrays and execute nothing: of a motion, \
             scripts/motion_pickle_to_npz.py {0} motion.npz; of a body model, scripts/smpl_pickle_to_npz.py {0} model.npz",
            path.display()
        ));
    }
    let is = |extensions: &[&str]| extensions.iter().any(|extension| has_extension(path, extension));
    let (_, what, mesh, motion) = FORMATS.iter().find(|(extensions, ..)| is(extensions))?;
    Some(format!(
        "{what}, which is not read here; for a garment or body, {BLENDER} {mesh}; for a motion, {motion}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_that_are_not_read_have_a_way_out() {
        for (name, part) in [
            ("a.FBX", "export glTF"),
            ("a.fbx", "BVH"),
            ("a.usdz", "OBJ"),
            ("a.blend", "glTF"),
            ("a.dae", "glTF"),
            ("a.c3d", "BVH"),
            ("a.pkl", "smpl_pickle_to_npz.py a.pkl"),
            ("a.pkl", "motion_pickle_to_npz.py a.pkl motion.npz"),
        ] {
            let found = way_out(Path::new(name)).unwrap();
            assert!(found.contains(part), "{found}");
        }
        for name in ["a.obj", "a.npz", "a.bvh", "a.glb", "fbx", "a"] {
            assert_eq!(way_out(Path::new(name)), None, "{name}");
        }
    }
}
