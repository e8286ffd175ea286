#!/usr/bin/env python3
"""DiffusionNet's published preparation beside ours, on the same mesh and one core.

    cargo build --release -p clothcombo-physics --example operators
    python3 scripts/bench_operators.py [--vertices 8000] [--eigen-count 128]

The steps are those of diffusion_net/geometry.py (Sharp et al. 2022, compute_operators): cotangent Laplacian and lumped mass,
scipy's eigsh in shift-invert mode, and the least-squares gradient built vertex by vertex in Python. Needs numpy and scipy.
The eigenvalues must agree before any time is printed.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg


def read_obj(path):
    positions, faces = [], []
    for line in open(path):
        if line.startswith("v "):
            positions.append([float(x) for x in line.split()[1:4]])
        elif line.startswith("f "):
            faces.append([int(x.split("/")[0]) - 1 for x in line.split()[1:4]])
    return np.array(positions), np.array(faces)


def laplacian_and_mass(positions, faces):
    count = len(positions)
    corners = positions[faces]
    rows, columns, values = [], [], []
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    for k in range(3):
        a, b, c = faces[:, k], faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        u, v = positions[a] - positions[c], positions[b] - positions[c]
        weight = 0.5 * (u * v).sum(1) / np.linalg.norm(np.cross(u, v), axis=1)
        rows += [a, b, a, b]
        columns += [b, a, a, b]
        values += [-weight, -weight, weight, weight]
    matrix = sparse.coo_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count)
    ).tocsc()
    mass = np.zeros(count)
    for k in range(3):
        np.add.at(mass, faces[:, k], area / 3)
    return matrix, mass


def vertex_frames(positions, faces):
    corners = positions[faces]
    normals = np.zeros_like(positions)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for k in range(3):
        np.add.at(normals, faces[:, k], cross)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-12
    axis = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    x = axis - (axis * normals).sum(1, keepdims=True) * normals
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return x, np.cross(normals, x)


def gradient(positions, frames, edges):
    """build_grad of the published code: one small least-squares problem per vertex, in a Python loop."""
    count = len(positions)
    outgoing = [[] for _ in range(count)]
    for index, (tail, tip) in enumerate(edges):
        outgoing[tail].append((index, tip))
    vectors = positions[edges[:, 1]] - positions[edges[:, 0]]
    tangent = np.stack([(vectors * axis[edges[:, 0]]).sum(1) for axis in frames], 1)
    rows, columns, values = [], [], []
    for vertex in range(count):
        neighbours = len(outgoing[vertex])
        if neighbours == 0:
            continue
        left = np.zeros((neighbours, 2))
        right = np.zeros((neighbours, neighbours + 1))
        indices = [vertex]
        for i, (edge, tip) in enumerate(outgoing[vertex]):
            indices.append(tip)
            left[i] = tangent[edge]
            right[i, 0] = -1
            right[i, i + 1] = 1
        left_transposed = left.T
        solution = np.linalg.inv(left_transposed @ left + 1e-5 * np.identity(2)) @ left_transposed @ right
        for i, neighbour in enumerate(indices):
            rows.append(vertex)
            columns.append(neighbour)
            values.append(solution[0, i] + 1j * solution[1, i])
    return sparse.coo_matrix((values, (rows, columns)), (count, count)).tocsc()


def operators(positions, faces, eigen_count):
    matrix, mass = laplacian_and_mass(positions, faces)
    # As published: a small shift makes the matrix positive definite.
    shifted = (matrix + sparse.identity(len(positions)) * 1e-8).tocsc()
    values, vectors = linalg.eigsh(shifted, k=eigen_count, M=sparse.diags(mass), sigma=1e-8)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    gradient(positions, vertex_frames(positions, faces), edges)
    return np.clip(values, 0, None)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--vertices", type=int, default=8000)
parser.add_argument("--eigen-count", type=int, default=128)
parser.add_argument("--repeats", type=int, default=3)
parser.add_argument("--program", default="target/release/examples/operators")
arguments = parser.parse_args()

with tempfile.TemporaryDirectory() as folder:
    mesh = os.path.join(folder, "mesh.obj")
    command = [arguments.program, "--vertices", str(arguments.vertices), "--eigen-count", str(arguments.eigen_count),
               "--seconds", "0.1", "--export", mesh]
    ours, theirs = [], []
    for _ in range(arguments.repeats):
        found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        ours.append(found["milliseconds"])
        positions, faces = read_obj(mesh)
        start = time.perf_counter()
        values = operators(positions, faces, arguments.eigen_count)
        theirs.append(1e3 * (time.perf_counter() - start))
difference = np.abs(np.array(found["eigenvalues"]) - values).max() / values.max()
if difference > 1e-5:
    sys.exit(f"the eigenvalues differ by {difference:.1e} of the largest: nothing is compared")
ours, theirs = np.median(ours), np.median(theirs)
print(f"{found['vertices']} vertices, {arguments.eigen_count} eigenpairs, one core: ours {ours:.0f} ms, "
      f"DiffusionNet's preparation {theirs:.0f} ms, ratio {theirs / ours:.1f}; eigenvalues agree to {difference:.0e}")
