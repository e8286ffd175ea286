#!/usr/bin/env python3
"""Writes data/tests/fixtures/import/: files in the layouts the importers read, and what should come out.

Independent of the Rust code: files are made with numpy and scipy.io.savemat, expectations with the numpy formulas below.
Needs numpy and scipy. Run again only to change the fixtures; they are committed.

usage: scripts/write_import_fixtures.py [FOLDER]
"""
import os
import struct
import sys

import numpy as np
from scipy import io as sio
from scipy.sparse import csc_matrix
from scipy.spatial.transform import Rotation

OUT = sys.argv[1] if len(sys.argv) > 1 else os.path.join(
    os.path.dirname(os.path.abspath(__file__)), "..", "data", "tests", "fixtures", "import")
rng = np.random.default_rng(20)


def path(*parts):
    full = os.path.join(OUT, *parts)
    os.makedirs(os.path.dirname(full), exist_ok=True)
    return full


# --- linear blend skinning, as the SMPL papers write it ----------------------------------------------------------------

def rotation(axis_angle):
    return Rotation.from_rotvec(axis_angle).as_matrix()


def skinned(model, betas, pose):
    """Posed vertices and the pelvis of the shaped body, all in f64. pose: [J, 3]."""
    template = model["v_template"].astype(float)
    shaped = template + model["shapedirs"].astype(float)[:, :, : len(betas)] @ betas
    joints = model["J_regressor"].astype(float) @ shaped
    parents = model["parents"]
    turns = np.stack([rotation(r) for r in pose])
    if "posedirs" in model:
        feature = (turns[1:] - np.eye(3)).reshape(-1)
        shaped = shaped + model["posedirs"].astype(float) @ feature
    world = [np.eye(4) for _ in parents]
    for j, parent in enumerate(parents):
        local = np.eye(4)
        local[:3, :3] = turns[j]
        local[:3, 3] = joints[j] - (joints[parent] if parent >= 0 else 0.0)
        world[j] = world[parent] @ local if parent >= 0 else local
    bones = np.stack(world)
    bones[:, :3, 3] -= np.einsum("jab,jb->ja", bones[:, :3, :3], joints)
    weights = model["weights"].astype(float)
    weights = weights / weights.sum(1, keepdims=True)
    blended = np.einsum("vj,jab->vab", weights, bones)
    return np.einsum("vab,vb->va", blended[:, :3, :3], shaped) + blended[:, :3, 3], joints[0]


BODY_PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]


def parents_of(joint_count):
    if joint_count == 24:
        return BODY_PARENTS + [20, 21]
    fingers = []
    first = joint_count - 30
    for hand, wrist in enumerate([20, 21]):
        for finger in range(5):
            base = first + 15 * hand + 3 * finger
            fingers += [wrist, base, base + 1]
    face = [15, 15, 15] if joint_count == 55 else []
    return BODY_PARENTS + face + fingers


# --- three tiny models in the layouts of SMPL, SMPL-H and SMPL-X ------------------------------------------------------

def icosahedron():
    g = (1 + 5 ** 0.5) / 2
    v = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g],
                  [0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]])
    f = np.array([[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2],
                  [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5],
                  [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]])
    return 0.3 * v, f


def random_model(joints, components, used_joints):
    vertices, faces = icosahedron()
    n = len(vertices)
    weights = np.zeros((n, joints))
    for v in range(n):
        weights[v, rng.choice(used_joints, 3, replace=False)] = rng.uniform(0.1, 1.0, 3)
    regressor = rng.uniform(0, 1, (joints, n)) * (rng.uniform(0, 1, (joints, n)) < 0.4)
    regressor += np.eye(joints, n) * 0.1 + 1e-2
    return {
        "v_template": vertices + [0.02, -0.1, 0.03],
        "f": faces,
        "shapedirs": rng.normal(0, 0.02, (n, 3, components)),
        "posedirs": rng.normal(0, 0.003, (n, 3, 9 * (joints - 1))),
        "J_regressor": regressor / regressor.sum(1, keepdims=True),
        "weights": weights / weights.sum(1, keepdims=True),
        "parents": parents_of(joints),
    }


def kintree(model, dtype):
    table = np.array([model["parents"], list(range(len(model["parents"])))], dtype=np.int64)
    table[0, 0] = 2 ** 32 - 1 if dtype in (np.uint32, np.int64) else -1
    return table.astype(dtype)


class Loud:
    """Unpickling this would print; reading the archive must not."""

    def __reduce__(self):
        return (print, ("THE PICKLE WAS EXECUTED",))


def pickled(value):
    array = np.empty((), dtype=object)
    array[()] = value
    return array


def write_models():
    expected = {}

    def expect(name, model, shape_components, count=4):
        joints = len(model["parents"])
        betas = rng.normal(0, 1, (count, shape_components))
        poses = rng.normal(0, 0.5, (count, joints, 3))
        betas[0], poses[0] = 0, 0
        found = []
        for b, p in zip(betas, poses):
            posed, pelvis = skinned(model, b, p)
            found.append(posed - pelvis)
        expected[name + "_betas"], expected[name + "_poses"] = betas, poses
        expected[name + "_vertices"] = np.array(found)

    # SMPL: as scripts/smpl_pickle_to_npz.py writes it; doubles in C order, stored.
    model = random_model(24, 10, range(24))
    model["posedirs"] = model["posedirs"].astype(np.float32)
    np.savez(path("smpl_tiny.npz"), kintree_table=kintree(model, np.int64),
             **{k: model[k] for k in model if k not in ("parents", "f")}, f=model["f"].astype(np.uint32))
    expect("smpl_tiny", model, 10)

    # SMPL-H: singles, halves and big-endian numbers in Fortran order, deflated; the root's parent is −1 in 16 bits.
    model = random_model(52, 16, range(22))
    for key, kind in (("v_template", np.float32), ("shapedirs", ">f4"), ("posedirs", np.float16), ("J_regressor", ">f8"),
                      ("weights", np.float32)):
        model[key] = np.asfortranarray(model[key].astype(kind))
    np.savez_compressed(path("smplh_tiny.npz"), kintree_table=np.asfortranarray(kintree(model, np.int16)),
                        f=np.asfortranarray(model["f"].astype(np.uint8)), hands_meanl=np.zeros(45), hands_meanr=np.zeros(45),
                        **{k: model[k] for k in model if k not in ("parents", "f")})
    expect("smplh_tiny", model, 16)

    # SMPL-X: 10 shape and 10 expression components, unsigned tree with 2³² − 1, pickled members.
    model = random_model(55, 20, range(25))
    model["posedirs"] = np.where(np.arange(486) < 189, model["posedirs"], 0).astype(np.float16)
    np.savez_compressed(path("smplx_tiny.npz"), kintree_table=kintree(model, np.uint32), f=model["f"].astype(np.uint32),
                        joint2num=pickled({"Pelvis": 0, "loud": Loud()}), part2num=pickled(Loud()),
                        lmk_faces_idx=np.arange(51), lmk_bary_coords=np.ones((51, 3)) / 3,
                        hands_componentsl=np.eye(45, dtype=np.float32),
                        **{k: model[k] for k in model if k not in ("parents", "f")})
    shape_only = dict(model, shapedirs=model["shapedirs"][:, :, :10])
    expect("smplx_tiny", shape_only, 10)
    np.savez_compressed(path("expected_bodies.npz"), **expected)

    # Wrong ones: each differs from a good file by one defect.
    good = random_model(24, 2, range(24))
    good = {k: good[k].astype(np.float32) for k in ("v_template", "shapedirs", "J_regressor", "weights")}
    good.update(f=icosahedron()[1].astype(np.uint32), kintree_table=kintree({"parents": parents_of(24)}, np.int64))

    def wrong(name, **changes):
        arrays = {k: v for k, v in {**good, **changes}.items() if v is not None}
        np.savez_compressed(path("wrong", name + ".npz"), **arrays)

    def changed(key, at, value):
        array = good[key].copy()
        array[at] = value
        return {key: array}

    for key in ("v_template", "f", "shapedirs", "J_regressor", "weights", "kintree_table"):
        wrong("without_" + key, **{key: None})
    wrong("weights_of_23_joints", weights=good["weights"][:, :23])
    wrong("weights_sum_to_zero", **changed("weights", 3, 0))
    wrong("face_beyond_vertices", **changed("f", (7, 1), 12))
    wrong("negative_face", f=(good["f"].astype(np.int64) - 1))
    wrong("nan_vertex", **changed("v_template", (4, 2), np.nan))
    wrong("parent_after_child", **changed("kintree_table", (0, 2), 9))
    wrong("pickled_weights", weights=pickled(Loud()))
    wrong("text_weights", weights=np.array(["a", "b"]))
    wrong("complex_weights", weights=good["weights"].astype(np.complex64))
    wrong("flat_shapedirs", shapedirs=good["shapedirs"].reshape(-1, 2))


# --- AMASS -------------------------------------------------------------------------------------------------------------

def write_amass():
    upright = rotation([np.pi / 2, 0, 0])

    def clip(frames, columns):
        poses = np.cumsum(rng.normal(0, 0.06, (frames, columns)), 0)
        # Standing in a z-up world, turning about the vertical.
        for i in range(frames):
            poses[i, :3] = Rotation.from_matrix(rotation([0, 0, 0.3 * i]) @ rotation(0.1 * rng.normal(size=3)) @ upright).as_rotvec()
        return poses

    expected = {}

    def expect(name, poses, kept):
        kept = poses[kept]
        expected[name + "_body"] = kept[:, 3:66]
        to_y_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        expected[name + "_root"] = np.array([to_y_up @ rotation(r[:3]) for r in kept])

    # SMPL-H, 120 frames/s that are not quite 120, text gender; frames 5 to 9 stand still.
    poses = clip(14, 156)
    poses[5:10] = poses[4]
    np.savez(path("amass", "ACCAD", "s1", "walk_poses.npz"), poses=poses, trans=rng.normal(size=(14, 3)),
             betas=rng.normal(size=16), dmpls=rng.normal(size=(14, 8)), gender=np.array("female"),
             mocap_framerate=np.array(120.00004577636719))
    expect("walk_every_4", poses, [0, 4, 12])
    expect("walk_all", poses, range(14))
    # SMPL-X with the other spelling, bytes for gender, Fortran order and a pickle.
    poses = clip(9, 165)
    np.savez_compressed(path("amass", "CMU", "01", "jump_stageii.npz"), poses=np.asfortranarray(poses), trans=np.zeros((9, 3)),
                        root_orient=poses[:, :3], pose_body=poses[:, 3:66], pose_hand=poses[:, 75:], pose_jaw=poses[:, 66:69],
                        pose_eye=poses[:, 69:75], betas=np.zeros(16), gender=np.array(b"male"), mocap_frame_rate=np.array(60.0),
                        mocap_time_length=np.array(0.15), surface_model_type=np.array("smplx"),
                        markers_latent_vids=pickled({"ARIEL": Loud()}))
    expect("jump_every_2", poses, range(0, 9, 2))
    # The same name in another folder; single precision; gender as Python prints bytes.
    poses = clip(4, 156).astype(np.float32)
    np.savez(path("amass", "CMU", "02", "jump_poses.npz"), poses=poses, gender=np.array("b'female'"), mocap_framerate=np.float32(30))
    expect("second", poses.astype(float), range(4))
    # Not motions, or broken ones.
    np.savez(path("amass", "CMU", "01", "shape.npz"), betas=np.zeros(16), gender=np.array("male"))
    np.savez(path("amass", "CMU", "01", "male_stagei.npz"), betas=np.zeros(16), markers_latent=np.zeros((3, 3)))
    np.savez(path("amass", "CMU", "01", "pickled_poses.npz"), poses=pickled(Loud()), mocap_framerate=np.array(60.0))
    np.savez(path("amass", "CMU", "01", "narrow_poses.npz"), poses=np.zeros((2, 63)), mocap_framerate=np.array(60.0))
    np.savez(path("amass", "CMU", "01", "rateless_poses.npz"), poses=np.zeros((2, 66)))
    np.savez(path("amass", "CMU", "01", "stopped_poses.npz"), poses=np.zeros((2, 66)), mocap_framerate=np.array(0.0))
    bad = np.zeros((3, 66))
    bad[1, 10] = np.nan
    np.savez(path("amass", "CMU", "01", "nan_poses.npz"), poses=bad, mocap_framerate=np.array(60.0))
    np.savez(path("amass", "CMU", "01", "empty_poses.npz"), poses=np.zeros((0, 156)), mocap_framerate=np.array(60.0))
    with open(path("amass", "CMU", "01", "junk_poses.npz"), "wb") as f:
        f.write(b"this is no archive")
    with open(path("amass", "CMU", "LICENSE.txt"), "w") as f:
        f.write("not a motion either\n")
    np.savez_compressed(path("expected_amass.npz"), **expected)


# --- CLOTH3D -----------------------------------------------------------------------------------------------------------

SKELETON = np.array([
    [0, 0, 0], [.1, -.09, 0], [-.1, -.09, 0], [0, .11, -.02], [.13, -.47, 0], [-.13, -.47, 0], [0, .25, 0],
    [.13, -.9, -.03], [-.13, -.9, -.03], [0, .3, 0], [.15, -.96, .09], [-.15, -.96, .09], [0, .52, -.03], [.08, .42, -.02],
    [-.08, .42, -.02], [0, .6, .02], [.19, .45, -.02], [-.19, .45, -.02], [.45, .44, -.04], [-.45, .44, -.04],
    [.7, .45, -.04], [-.7, .45, -.04], [.78, .44, -.05], [-.78, .44, -.05]])
AROUND = 6


def tube_body(seed):
    """Tubes around the bones: joints, rings of vertices with their joint, quads."""
    local = np.random.default_rng(seed)
    parents = parents_of(24)
    joints = SKELETON + local.normal(0, 0.004, SKELETON.shape)
    vertices, owners, quads, rings = [], [], [], {}
    for child in range(1, 24):
        parent = parents[child]
        along = SKELETON[child] - SKELETON[parent]
        side = np.cross(along, [0.3, 0.5, 1.0])
        side /= np.linalg.norm(side)
        up = np.cross(along, side) / np.linalg.norm(along)
        radius = 0.05 if child in (1, 2, 4, 5, 7, 8) else 0.09 if child in (3, 6, 9) else 0.04
        start = len(vertices)
        for step in range(4):
            for k in range(AROUND):
                a = 2 * np.pi * k / AROUND
                vertices.append(SKELETON[parent] + along * (0.1 + 0.8 * step / 3) + radius * (np.cos(a) * side + np.sin(a) * up))
                owners.append((parent, child, step / 3))
        for step in range(3):
            for k in range(AROUND):
                i, j = start + step * AROUND + k, start + step * AROUND + (k + 1) % AROUND
                quads.append([i, j, j + AROUND, i + AROUND])
        rings[child] = (start, len(vertices))
    vertices = np.round(np.array(vertices) + local.normal(0, 0.002, (len(vertices), 3)), 4)
    weights = np.zeros((len(vertices), 24))
    for v, (parent, child, t) in enumerate(owners):
        weights[v, parent] += 1 - 0.3 * t
        weights[v, child] += 0.3 * t
    # The regressor gives each joint the mean of the rings next to it, near enough.
    regressor = np.zeros((24, len(vertices)))
    for j in range(24):
        near = np.argsort(np.linalg.norm(vertices - joints[j], axis=1))[:AROUND]
        regressor[j, near] = 1 / AROUND
    shapedirs = np.zeros((len(vertices), 3, 10))
    shapedirs[:, :, 0] = vertices * 0.05
    shapedirs[:, :, 1] = np.round(local.normal(0, 0.003, vertices.shape), 4)
    posedirs = np.zeros((len(vertices), 3, 207))
    # Of the features of both hips, one entry each.
    posedirs[:, :, [1, 10]] = np.round(local.normal(0, 0.004, (len(vertices), 3, 2)), 4)
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return {
        "v_template": vertices.astype(np.float32), "shapedirs": shapedirs.astype(np.float32),
        "posedirs": posedirs.astype(np.float16), "J_regressor": regressor.astype(np.float32),
        "weights": weights.astype(np.float32), "f": np.array(triangles, dtype=np.uint32), "parents": parents,
    }, quads, rings


def write_obj(name, vertices, quads):
    with open(name, "w") as f:
        f.write("# rest garment\no garment\n")
        for v in vertices:
            f.write("v %.7f %.7f %.7f\n" % tuple(v))
        f.write("vt 0.0 0.0\nvt 1.0 0.5\n")
        for n, (a, b, c, d) in enumerate(quads):
            if n % 3 == 0:
                f.write("f %d/1 %d/2 %d/1\nf %d/1 %d/2 %d/1\n" % (a + 1, b + 1, c + 1, a + 1, c + 1, d + 1))
            else:
                f.write("f %d/1 %d/2 %d/1 %d/2\n" % (a + 1, b + 1, c + 1, d + 1))


def write_pc16(name, points, frames_in_header=None, keep=None):
    frames = points.shape[0] if frames_in_header is None else frames_in_header
    data = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, points.shape[1], 0.0, 1.0, frames)
    data += points.astype("<f2").tobytes()
    with open(name, "wb") as f:
        f.write(data[:keep])


def save_mat(name, variables, compress):
    sio.savemat(name, variables, do_compression=compress)
    # The header holds the date; fixtures should not.
    with open(name, "r+b") as f:
        f.write(b"MATLAB 5.0 MAT-file fixture".ljust(116))


def write_cloth3d():
    neutral, quads, rings = tube_body(1)
    female, _, _ = tube_body(2)
    female["f"] = neutral["f"]
    for name, model in (("body_neutral", neutral), ("body_female", female)):
        np.savez_compressed(path("cloth3d_bodies", name + ".npz"), kintree_table=kintree(model, np.int64),
                            **{k: model[k] for k in model if k != "parents"})
    expected = {}

    def garment(children):
        """Vertices of the body's tubes around these bones, and the garment's quads."""
        ids = np.concatenate([np.arange(*rings[c]) for c in children])
        index = {v: i for i, v in enumerate(ids)}
        return ids, [[index[v] for v in q] for q in quads if all(v in index for v in q)]

    def rest(model, shape, zrot):
        """The body in the rest pose of CLOTH3D: z up, legs apart, root joint at the origin, turned by zrot."""
        pose = np.zeros((24, 3))
        pose[0], pose[1], pose[2] = [np.pi / 2, 0, 0], [0, 0, .15], [0, 0, -.15]
        posed, pelvis = skinned(model, shape, pose)
        return (posed - pelvis) @ rotation([0, 0, zrot]).T

    _, pelvis = skinned(neutral, np.zeros(10), np.zeros((24, 3)))
    zero_body = neutral["v_template"].astype(float) - pelvis
    top, top_quads = garment([3, 6, 9])
    trousers, trousers_quads = garment([4, 5, 7, 8])
    expected["Top"], expected["Trousers"] = zero_body[top], zero_body[trousers]

    # A woman, compressed, many frames.
    shape, zrot, frames = np.round(rng.normal(0, 1, 10), 3), 0.7, 6
    poses = np.cumsum(rng.normal(0, 0.1, (72, frames)), 1)
    poses[:3] = np.array([[np.pi / 2, 0, 0]] * frames).T
    os.makedirs(os.path.dirname(path("cloth3d", "00001", "x")), exist_ok=True)
    body = rest(female, shape, zrot)
    write_obj(path("cloth3d", "00001", "Top.obj"), body[top], top_quads)
    write_obj(path("cloth3d", "00001", "Trousers.obj"), body[trousers], trousers_quads)
    texture = {"type": "color", "data": np.array([0.1, 0.5, 0.9])}
    save_mat(path("cloth3d", "00001", "info.mat"), {
        "poses": poses, "trans": rng.normal(size=(3, frames)), "shape": shape, "gender": 0, "zrot": zrot,
        "tightness": np.array([-0.5, 1.25]), "camLoc": np.zeros((1, 3)),
        "outfit": {"Top": {"fabric": "silk", "texture": texture}, "Trousers": {"fabric": "denim", "texture": {"type": "pattern", "data": "dots"}}},
        "lights": np.array([[{"a": 1}]], dtype=object)}, True)
    simulated = rng.normal(0, 0.5, (frames, len(top), 3)).astype(np.float16)
    write_pc16(path("cloth3d", "00001", "Top.pc16"), simulated)
    expected["Top_simulated_z_up"] = simulated.astype(np.float32)
    expected["poses_z_up"] = poses.T
    write_pc16(path("cloth3d", "00001", "Trousers.pc16"), simulated[:, :5])

    # A man, not compressed, one frame; one garment has no file, one is broken; a cache is cut short.
    shape = np.round(rng.normal(0, 1, 10), 3)
    body = rest(neutral, shape, -2.1)
    write_obj(path("cloth3d", "00002", "Trousers.obj"), body[trousers], trousers_quads)
    write_pc16(path("cloth3d", "00002", "Trousers.pc16"), rng.normal(0, 0.5, (1, len(trousers), 3)), keep=600)
    with open(path("cloth3d", "00002", "Top.obj"), "w") as f:
        f.write("v 0 0 0\nv 1 0 zero\n")
    save_mat(path("cloth3d", "00002", "info.mat"), {
        "poses": np.concatenate([[np.pi / 2], np.zeros(71)]), "trans": np.zeros(3), "shape": shape, "gender": 1, "zrot": -2.1,
        "tightness": np.zeros(2), "outfit": {"Trousers": {"fabric": "cotton"}, "Dress": {"fabric": "leather"}, "Top": {}}}, False)

    # Broken samples.
    with open(path("cloth3d", "00001", "info.mat"), "rb") as f:
        whole = f.read()
    with open(path("cloth3d", "00003_truncated", "info.mat"), "wb") as f:
        f.write(whole[: len(whole) * 2 // 3])
    with open(path("cloth3d", "00004_text", "info.mat"), "w") as f:
        f.write("gender: 1\n")
    small = {"poses": np.zeros((72, 2)), "shape": np.zeros(10), "gender": 0, "zrot": 0.0, "outfit": {"Top": {"fabric": "silk"}}}
    for name, change in (("00005_gender", {"gender": 7}), ("00006_no_zrot", {"zrot": None}), ("00007_poses", {"poses": np.zeros((2, 71))}),
                         ("00008_outfit", {"outfit": np.zeros(3)}), ("00009_nan", {"shape": np.full(10, np.nan)})):
        save_mat(path("cloth3d", name, "info.mat"), {k: v for k, v in {**small, **change}.items() if v is not None}, True)
    np.savez_compressed(path("expected_cloth3d.npz"), **expected)


# --- every kind of value a MAT file can hold ---------------------------------------------------------------------------

def write_kinds():
    variables = {
        "matrix": np.array([[1.0, 2, 3], [4, 5, 6]]), "cube": np.arange(24.0).reshape(2, 3, 4), "scalar": 7.5,
        "empty": np.zeros((0, 3)), "flag": True, "text": "Größe", "lines": np.array(["one", "three"]), "no_text": "",
        "cells": np.array([1.0, "two", np.zeros((2, 0))], dtype=object), "complex": np.array([1 + 2j]),
        "sparse": csc_matrix(np.eye(3)), "after": np.float32(0.5),
        "nested": {"a": {"b": {"c_with_a_rather_long_field_name": np.int8(-3)}}, "list": np.array([[1, 2]], dtype=np.uint16)},
        "people": np.array([("Ada", 36.0), ("Alan", 41.0)], dtype=[("name", object), ("age", object)]),
    }
    for kind in ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32"):
        variables[kind] = np.array([1, 2, 100], dtype=kind)
    for name, compress in (("kinds.mat", False), ("kinds_compressed.mat", True)):
        sio.savemat(path("mat", name), variables, do_compression=compress, long_field_names=True)
        with open(path("mat", name), "r+b") as f:
            f.write(b"MATLAB 5.0 MAT-file fixture".ljust(116))
    sio.savemat(path("mat", "level4.mat"), {"matrix": np.eye(2)}, format="4")


# --- DeepMimic ---------------------------------------------------------------------------------------------------------

def write_deepmimic():
    """Random poses, and the directions of limbs in the world, by forward kinematics of the character."""
    def quaternion(r):
        x, y, z, w = r.as_quat()
        return [w, x, y, z]

    rows, bones = [], []
    for frame in range(5):
        turn = {name: Rotation.from_rotvec(rng.normal(0, 0.5, 3)) for name in
                ("root", "chest", "neck", "right_hip", "right_ankle", "right_shoulder", "left_hip", "left_ankle", "left_shoulder")}
        angle = {name: s * rng.uniform(0, 1.5) for name, s in
                 (("right_knee", -1), ("left_knee", -1), ("right_elbow", 1), ("left_elbow", 1))}
        if frame == 0:
            turn, angle = {k: Rotation.identity() for k in turn}, {k: 0.0 for k in angle}
        row = [0.0 if frame == 4 else 0.033333, 0.1 * frame, 0.85, 0.0]
        for name in ("root", "chest", "neck", "right_hip", "right_knee", "right_ankle", "right_shoulder", "right_elbow",
                     "left_hip", "left_knee", "left_ankle", "left_shoulder", "left_elbow"):
            row += quaternion(turn[name]) if name in turn else [angle[name]]
        rows.append(row)
        hinge = {k: Rotation.from_rotvec([0, 0, a]) for k, a in angle.items()}
        chest = turn["root"] * turn["chest"]
        down, out = [0, -1, 0], []
        for side in ("left", "right"):
            thigh = turn["root"] * turn[side + "_hip"]
            shank = thigh * hinge[side + "_knee"]
            upper = chest * turn[side + "_shoulder"]
            lower = upper * hinge[side + "_elbow"]
            out += [r.apply(down) for r in (thigh, shank, upper, lower)]
        bones.append(out)
    with open(path("deepmimic", "humanoid3d_random.txt"), "w") as f:
        f.write('{\n"Loop": "none",\n"Frames":\n[\n')
        f.write(",\n".join("[" + ", ".join("%.9f" % x for x in row) + "]" for row in rows))
        f.write("\n]\n}")
    np.savez_compressed(path("expected_deepmimic.npz"), bones=np.array(bones))
    with open(path("deepmimic", "dog.txt"), "w") as f:
        f.write('{"Loop": "wrap", "Frames": [[0.1, 0, 0.4, 0, 1, 0, 0, 0]]}')
    with open(path("deepmimic", "cut.txt"), "w") as f:
        f.write('{"Loop": "wrap", "Frames": [[0.1, 0, 0.4, 0, 1, 0')


# --- Acclaim -----------------------------------------------------------------------------------------------------------

def write_acclaim():
    """A skeleton with the names of the CMU database, and where its limbs point. Joints are turned from the leaves to the root,
    each with all that hangs on it, about axes fixed at rest."""
    own = np.random.default_rng(7)
    bones = {}

    def bone(name, parent, direction, length, axis=(0, 0, 0), dof=""):
        bones[name] = (parent, np.array(direction, float) / np.linalg.norm(direction), length, axis, dof.split())

    for name, parent in (("lowerback", "root"), ("upperback", "lowerback"), ("thorax", "upperback"), ("lowerneck", "thorax"),
                         ("upperneck", "lowerneck"), ("head", "upperneck")):
        bone(name, parent, (0, 1, 0), 2, dof="rx ry rz")
    for s, x in (("l", 1), ("r", -1)):
        bone(s + "hipjoint", "root", (0.6 * x, -0.8, 0), 2.5)
        bone(s + "femur", s + "hipjoint", (0.34 * x, -0.94, 0), 7, (0, 0, 20 * x), "rx ry rz")
        bone(s + "tibia", s + "femur", (0.34 * x, -0.94, 0), 7.5, (0, 0, 20 * x), "rx")
        bone(s + "foot", s + "tibia", (0, -0.2, 1), 2, (-90, 0, 20 * x), "rx rz")
        bone(s + "toes", s + "foot", (0, 0, 1), 1, (-90, 0, 20 * x), "rx")
        bone(s + "clavicle", "thorax", (0.9 * x, 0.4, 0), 3.5, dof="ry rz")
        bone(s + "humerus", s + "clavicle", (x, 0, 0), 5, (180, -30 * x, -90 * x), "rx ry rz")
        bone(s + "radius", s + "humerus", (x, 0, 0), 3.5, (180, -30 * x, -90 * x), "rx")
        bone(s + "wrist", s + "radius", (x, 0, 0), 2, (0, 90 * x, 90 * x), "ry")
        bone(s + "hand", s + "wrist", (x, 0, 0), 1, (0, 90 * x, 90 * x), "rx rz")
    with open(path("acclaim", "07", "07.asf"), "w") as f:
        f.write("# made by scripts/write_import_fixtures.py\n:version 1.10\n:name made\n:units\n  mass 1.0\n  length 0.45\n  angle deg\n"
                ":documentation\n  begin of nothing\n:root\n  order TX TY TZ RX RY RZ\n  axis XYZ\n  position 0 0 0\n  orientation 0 0 0\n:bonedata\n")
        for name, (_, d, length, axis, dof) in bones.items():
            f.write("  begin\n    name %s\n    direction %.9g %.9g %.9g\n    length %g\n    axis %g %g %g XYZ\n" % (name, *d, length, *axis))
            if dof:
                f.write("    dof %s\n    limits %s\n" % (" ".join(dof), "\n           ".join(["(-170 170)"] * len(dof))))
            f.write("  end\n")
        f.write(":hierarchy\n  begin\n")
        for parent in ["root", *bones]:
            children = [name for name, b in bones.items() if b[0] == parent]
            f.write("    %s\n" % " ".join([parent, *children]) if children else "")
        f.write("  end\n")

    def about(axis, degrees):
        return rotation(np.radians(degrees) * np.array(axis))

    def subtree(top):
        return [top] + [n for name, b in bones.items() if b[0] == top for n in subtree(name)]

    pointing = []
    limbs = [s + part for s in "lr" for part in ("femur", "tibia", "humerus", "radius")]
    with open(path("acclaim", "07", "07_01.amc"), "w") as f:
        f.write("#!OML:ASF made.ASF\n:FULLY-SPECIFIED\n:DEGREES\n")
        for frame in range(5):
            root = own.uniform(-25, 25, 3)
            values = {name: own.uniform(-40, 40, len(b[4])) for name, b in bones.items() if b[4]}
            f.write("%d\nroot 1 17 -3 %s\n" % (frame + 1, " ".join("%.9f" % x for x in root)))
            for name, row in values.items():
                f.write("%s %s\n" % (name, " ".join("%.9f" % x for x in row)))
            direction = {name: b[1] for name, b in bones.items()}
            for name in list(bones)[::-1] + ["root"]:
                axis, dof = bones[name][3:] if name != "root" else ((0, 0, 0), ["rx", "ry", "rz"])
                fixed = about([0, 0, 1], axis[2]) @ about([0, 1, 0], axis[1]) @ about([1, 0, 0], axis[0])
                for d, value in zip(dof, values.get(name, []) if name != "root" else root):
                    turn = about(fixed[:, "xyz".index(d[1])], value)
                    for moved in subtree(name)[name == "root":]:
                        direction[moved] = turn @ direction[moved]
            pointing.append([direction[name] for name in limbs])
    np.savez_compressed(path("expected_acclaim.npz"), bones=np.array(pointing))


if __name__ == "__main__":
    write_models()
    write_amass()
    write_cloth3d()
    write_kinds()
    write_deepmimic()
    write_acclaim()
    total = sum(os.path.getsize(os.path.join(d, f)) for d, _, files in os.walk(OUT) for f in files)
    print("%s: %d files, %.0f kB" % (OUT, sum(len(f) for _, _, f in os.walk(OUT)), total / 1000))
