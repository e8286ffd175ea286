#!/usr/bin/env python3
"""Compares the library's skinning with numpy's on random poses and shapes.

usage: scripts/check_skinning.py BODY.npz [--count 100] [--seed 0] [--limit 1e-5] [--binary FILE]

Needs numpy; builds and runs the example pose_body of the data crate. The numpy side is written from the papers' formulas
with 4x4 transforms, from the file's numbers in f64. Exits with 1 if a vertex is farther off than the limit [m].
"""
import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")


def rodrigues(r):
    """[n, 3] axis-angle to [n, 3, 3]."""
    angle = np.linalg.norm(r, axis=1)
    axis = r / np.where(angle > 0, angle, 1)[:, None]
    cross = np.zeros((len(r), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = axis
    cross[:, [1, 2, 0], [2, 0, 1]] = -axis
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return c * np.eye(3) + s * cross + (1 - c) * axis[:, :, None] * axis[:, None, :]


def posed(model, beta, pose):
    """Vertices and joints, pelvis at the origin."""
    parents = model["kintree_table"][0].astype(np.int64)
    shaped = model["v_template"] + model["shapedirs"] @ beta
    if "J_template" in model:
        joints = model["J_template"] + model["J_shapedirs"] @ beta
    else:
        joints = model["J_regressor"] @ shaped
    turns = rodrigues(pose)
    if "posedirs" in model:
        shaped = shaped + model["posedirs"] @ (turns[1:] - np.eye(3)).ravel()
    world = np.zeros((len(joints), 4, 4))
    for j in range(len(joints)):
        local = np.eye(4)
        local[:3, :3] = turns[j]
        local[:3, 3] = joints[j] - (joints[parents[j]] if j else 0)
        world[j] = world[parents[j]] @ local if j else local
    places = world[:, :3, 3].copy()
    world[:, :3, 3] -= np.einsum("jab,jb->ja", world[:, :3, :3], joints)
    weights = model["weights"] / model["weights"].sum(1, keepdims=True)
    blended = np.tensordot(weights, world[:, :3], 1)
    vertices = np.einsum("vab,vb->va", blended[:, :, :3], shaped) + blended[:, :, 3]
    return vertices - joints[0], places - joints[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("body")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=1e-5)
    parser.add_argument("--binary", help="the example, already built")
    a = parser.parse_args()
    with np.load(a.body) as file:
        keys = ("v_template", "shapedirs", "weights", "kintree_table", "J_template", "J_shapedirs", "J_regressor", "posedirs")
        model = {k: file[k].astype(np.float64) for k in keys if k in file.files}
    joints, components = model["weights"].shape[1], model["shapedirs"].shape[2]
    rng = np.random.default_rng(a.seed)
    betas = rng.normal(0, 1, (a.count, components))
    poses = rng.normal(0, 0.4, (a.count, joints, 3))
    poses[:, 0] *= 3
    with tempfile.TemporaryDirectory() as folder:
        given, found = os.path.join(folder, "in.npz"), os.path.join(folder, "out.npz")
        np.savez(given, betas=betas, poses=poses)
        command = ["cargo", "run", "--quiet", "--release", "-p", "clothcombo-data", "--example", "pose_body", "--"]
        command = [os.path.abspath(a.binary)] if a.binary else command
        subprocess.run(command + [os.path.abspath(a.body), given, found], cwd=ROOT, check=True)
        with np.load(found) as file:
            vertices, places = file["vertices"], file["joints"]
    worst_vertex = worst_joint = total = 0.0
    for i in range(a.count):
        v, j = posed(model, betas[i], poses[i])
        distance = np.linalg.norm(v - vertices[i], axis=1)
        worst_vertex, total = max(worst_vertex, distance.max()), total + distance.mean()
        worst_joint = max(worst_joint, np.linalg.norm(j - places[i], axis=1).max())
    print("%s: %d vertices, %d joints, %d shape components, %d random poses and shapes"
          % (a.body, len(model["v_template"]), joints, components, a.count))
    print("vertices: %.2e m at worst, %.2e m on average; joints: %.2e m at worst; limit %.0e m"
          % (worst_vertex, total / a.count, worst_joint, a.limit))
    return 0 if max(worst_vertex, worst_joint) <= a.limit else 1


if __name__ == "__main__":
    sys.exit(main())
