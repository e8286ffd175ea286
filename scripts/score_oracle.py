#!/usr/bin/env python3
"""The eight energies of ClothCombo from OBJ files, by brute force in numpy: an oracle for `clothcombo score`.

Written from the formulas of the paper and of `physics/src/energy/`, sharing no code with the Rust side. Metres, joules.

    scripts/score_oracle.py --body body.obj --rest r1.obj r2.obj --draped d1.obj d2.obj [--canonical c1.obj c2.obj]
    scripts/score_oracle.py …the same… --compare score.json     # against `clothcombo score --json`; exit 1 beyond 1e-6

Garments go from the body outwards. Distances to the body are those to the nearest vertex (no --surface here). Holding is
measured on canonical meshes (before skinning) against the rest meshes, so it needs --canonical.
"""
import argparse
import json
import sys
from pathlib import Path

import numpy as np

THICKNESS, DENSITY = 4.7e-4, 426.0  # m, kg/m³
MU, LAMBDA = 2.36e4, 4.44e4  # Pa
BENDING_STIFFNESS, GRAVITY = 3.96e-5, 9.81  # J/rad², m/s²
EPSILON, REPULSION_RADIUS, LAYER_RADIUS = 2e-3, 0.1, 0.1  # m
HELD_SHARE = 0.1
WEIGHTS = dict(strain=1.0, bending=5.0, gravity=1.0, body_collision=250.0, repulsion=0.001, holding=100.0)
# Where a formula has no value: see the documentation of each term.
CONTACT, COLLAPSE, COLLAPSE_FLOOR = 1e-4, 1e-4, 1e-6
FOLD, FOLD_FLOOR = 0.05, 1e-3


class Mesh:
    """Vertices [V, 3] and triangles [F, 3] of an OBJ file; polygons are fans about their first corner."""

    def __init__(self, path):
        self.name, vertices, faces = Path(path).stem, [], []
        for line in open(path, errors="replace"):
            key, *words = line.split("#")[0].split() or [""]
            if key == "v":
                vertices.append([float(word) for word in words[:3]])
            elif key == "f":
                index = [int(word.split("/")[0]) for word in words]
                index = [i - 1 if i > 0 else len(vertices) + i for i in index]
                faces += [[index[0], b, c] for b, c in zip(index[1:], index[2:])]
        self.x, self.faces = np.array(vertices), np.array(faces)
        lengths = np.sort(np.linalg.norm(self.x[self.edges()[:, 0]] - self.x[self.edges()[:, 1]], axis=1))
        self.median_edge = lengths[len(lengths) // 2]

    def edges(self):
        """Every edge once, lower index first."""
        half = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        return np.unique(np.sort(half, axis=1), axis=0)

    def hinges(self):
        """[a, b, c, d, first face, second face] of each edge a b with exactly two triangles, apexes c and d."""
        of_edge = {}
        for f, face in enumerate(self.faces):
            for k in range(3):
                a, b, apex = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
                of_edge.setdefault((min(a, b), max(a, b)), []).append((apex, f))
        both = [(*edge, *zip(*found)) for edge, found in of_edge.items() if len(found) == 2]
        return np.array([[a, b, *apexes, *faces] for a, b, apexes, faces in both], dtype=int).reshape(-1, 6)

    def doubled_areas(self, x):
        """Cross products of the triangles at positions x."""
        a, b, c = (x[self.faces[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    def vertex_sums(self, of_faces):
        """Per vertex, the sum over its triangles."""
        sums = np.zeros((len(self.x), *of_faces.shape[1:]))
        for k in range(3):
            np.add.at(sums, self.faces[:, k], of_faces)
        return sums


def length(v):
    return np.linalg.norm(v, axis=-1)


def dot(a, b):
    return (a * b).sum(-1)


def squared_distances(points, among):
    """All of them, [N, M]; coordinate by coordinate, because differences of squares would cancel."""
    return sum((points[:, k, None] - among[:, k]) ** 2 for k in range(3))


def nearest(points, among):
    """For each point, the index of the nearest of `among`, the lowest of equals."""
    blocks = np.array_split(points, len(points) // 64 + 1)
    return np.concatenate([squared_distances(block, among).argmin(1) for block in blocks])


def strain(rest, x):
    """Σ area·thickness·(λ/2 tr(G)² + μ tr(G²)), G = ½(FᵀF − I)."""
    energy = 0.0
    for face in rest.faces:
        sides = [length(rest.x[face[(k + 1) % 3]] - rest.x[face[k]]) for k in range(3)]
        a, b, c = np.roll(face, -max(range(3), key=lambda k: (sides[k], k)))  # the longest side (of equals the last) first

        def edges(y):
            return np.stack([y[b] - y[a], y[c] - y[a]], axis=1)  # [3, 2]

        base, side = edges(rest.x).T
        true_length, doubled = length(base), length(np.cross(base, side))
        along = base @ side / true_length if true_length > 0 else 0.0
        true_height = doubled / true_length if true_length > 0 else 0.0
        if doubled == 0:
            continue
        F = edges(x) @ np.linalg.inv([[true_length, along], [0.0, true_height]])
        G = 0.5 * (F.T @ F - np.eye(2))
        energy += 0.5 * doubled * THICKNESS * (LAMBDA / 2 * np.trace(G) ** 2 + MU * np.trace(G @ G))
    return energy


def bending(rest, x):
    """Σ k/2·α² over interior edges, each times t²(6 − 8t + 3t²), t = s²/τ² ≤ 1, of its two triangles, s being twice the area."""
    hinges = rest.hinges()
    a, b, c, d = (x[hinges[:, k]] for k in range(4))
    normals = [np.cross(b - a, c - a), np.cross(d - a, b - a)]  # both seen from one side of the sheet
    rest_areas = length(rest.doubled_areas(rest.x))
    scale = 1.0
    for k, normal in enumerate(normals):
        tau = np.maximum(FOLD * rest_areas[hinges[:, 4 + k]], FOLD_FLOOR * rest.median_edge**2)
        t = np.minimum(dot(normal, normal) / tau**2, 1)
        scale = scale * t**2 * (6 - 8 * t + 3 * t**2)
    n, m = (normal / np.maximum(length(normal), 1e-300)[:, None] for normal in normals)
    alpha = 2 * np.arctan2(length(n - m), length(n + m))  # unsigned, accurate at 0 and π
    return (BENDING_STIFFNESS / 2 * alpha**2 * scale).sum()


def gravity(rest, x):
    """Σ m·g·y from the origin, a third of the rest mass of its triangles at each vertex."""
    areas = 0.5 * length(rest.doubled_areas(rest.x))
    masses = rest.vertex_sums(areas) * THICKNESS * DENSITY / 3
    return GRAVITY * masses @ x[:, 1]


def body_gaps(body, x):
    """Signed distance to the nearest body vertex along its area-weighted normal, that vertex, and whether it has one."""
    used = np.unique(body.faces)  # vertices without a triangle are no part of the body
    sums = body.vertex_sums(body.doubled_areas(body.x))
    normals = sums / np.maximum(length(sums), 1e-300)[:, None]
    v = used[nearest(x, body.x[used])]
    return dot(x - body.x[v], normals[v]), v, length(sums)[v] > 0


def body_collision(gaps, has_normal):
    """Σ max(ε − d, 0)³."""
    return (np.maximum(EPSILON - gaps[has_normal], 0) ** 3).sum()


def repulsion(rest, x):
    """(1/N) Σ −log d² over unordered pairs closer than 0.1 m that share no edge; below 0.1 mm linear in d²."""
    edges, energy, block = rest.edges(), 0.0, 256
    for start in range(0, len(x), block):
        rows = np.arange(start, min(start + block, len(x)))
        squared = squared_distances(x[rows], x)
        counts = (squared < REPULSION_RADIUS**2) & (np.arange(len(x)) > rows[:, None])
        here = edges[(edges[:, 0] >= start) & (edges[:, 0] < start + block)]
        counts[here[:, 0] - start, here[:, 1]] = False
        squared = squared[counts]
        touching = squared < CONTACT**2
        energy -= np.log(squared[~touching]).sum()
        energy += (1 - squared[touching] / CONTACT**2 - np.log(CONTACT**2)).sum()
    return energy / len(x)


def holding(rest, canonical):
    """Σ (y − y_rest)² over the tenth of the vertices (rounded up) that is highest at rest."""
    count = int(np.ceil(HELD_SHARE * len(rest.x) - 1e-9))
    held = np.argsort(-rest.x[:, 1], kind="stable")[:count]
    return ((canonical[held, 1] - rest.x[held, 1]) ** 2).sum()


def layer_collision(inner, x_inner, x_outer):
    """Σ max(ε − d, 0)³ over outer vertices, d along n = N/√(|N|² + τ²) of the nearest inner vertex; not gated."""
    sums, at_rest = (inner.vertex_sums(inner.doubled_areas(y)) for y in (x_inner, inner.x))
    tau = np.maximum(COLLAPSE * length(at_rest), COLLAPSE_FLOOR * inner.median_edge**2)
    normals = sums / np.sqrt(dot(sums, sums) + tau**2)[:, None]
    v = nearest(x_outer, x_inner)
    gaps = dot(x_outer - x_inner[v], normals[v])
    return (np.maximum(EPSILON - gaps, 0) ** 3)[np.isin(v, inner.faces)].sum()


def layer_distance(inner, outer):
    """Σ max(d_inner − d_outer, 0)³ over pairs that have the same body vertex and are both closer than 0.1 m to it."""
    energy = 0.0
    (d_inner, v_inner), (d_outer, v_outer) = ([a[gaps < LAYER_RADIUS] for a in (gaps, v)] for gaps, v in (inner, outer))
    for v in np.intersect1d(v_inner, v_outer):
        below = d_inner[v_inner == v][:, None] - d_outer[v_outer == v]
        energy += (np.maximum(below, 0) ** 3).sum()
    return energy


def score(body, rests, draped, canonical):
    garments, near = [], []
    for i, (rest, mesh) in enumerate(zip(rests, draped)):
        if len(rest.x) != len(mesh.x) or not np.array_equal(rest.faces, mesh.faces):
            sys.exit(f"{mesh.name}: {len(mesh.x)} vertices, its rest mesh {len(rest.x)}; both must have the same faces")
        gaps, vertices, has_normal = body_gaps(body, mesh.x)
        near.append((gaps, vertices))
        raw = dict(
            strain=strain(rest, mesh.x),
            bending=bending(rest, mesh.x),
            gravity=gravity(rest, mesh.x),
            body_collision=body_collision(gaps, has_normal),
            repulsion=repulsion(rest, mesh.x),
        )
        if canonical:
            raw["holding"] = holding(rest, canonical[i].x)
        raw = {term: float(value) for term, value in raw.items()}
        weighted = {term: WEIGHTS[term] * value for term, value in raw.items()}
        garments.append(dict(name=mesh.name, raw=raw, weighted=weighted))
    layers = [
        dict(
            inner=i,
            outer=j,
            layer_collision=float(layer_collision(rests[i], draped[i].x, draped[j].x)),
            layer_distance=float(layer_distance(near[i], near[j])),
        )
        for i in range(len(draped))
        for j in range(i + 1, len(draped))
    ]
    return dict(garments=garments, layers=layers)


def compare(ours, theirs, tolerance):
    """Prints the relative difference of every value both have; whether all are within the tolerance."""
    worst, rows = 0.0, []
    pairs = [(g["name"], g["raw"], h["raw"]) for g, h in zip(ours["garments"], theirs["garments"], strict=True)]
    for a, b in zip(ours["layers"], theirs["layers"], strict=True):
        terms = {key: a[key] for key in ("layer_collision", "layer_distance")}
        pairs.append((f"{a['inner']} under {a['outer']}", terms, b))
    for name, a, b in pairs:
        for term in a:
            if term not in b and term == "holding":
                continue  # a score of no canonical meshes leaves it out
            difference = abs(a[term] - b[term])
            relative = difference / max(abs(a[term]), abs(b[term])) if difference else 0.0
            worst = max(worst, relative)
            rows.append(f"{name:<28} {term:<16} {a[term]:>20.12e} {b[term]:>20.12e} {relative:>9.1e}")
    print(f"{'':<28} {'term':<16} {'oracle':>20} {'score':>20} {'relative':>9}", *rows, sep="\n")
    print(f"largest relative difference {worst:.1e}, allowed {tolerance:.0e}")
    return worst <= tolerance


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--body", required=True)
    parser.add_argument("--rest", nargs="+", required=True)
    parser.add_argument("--draped", nargs="+", required=True)
    parser.add_argument("--canonical", nargs="+", default=[])
    parser.add_argument("--compare", metavar="SCORE.json")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    arguments = parser.parse_args()
    rests, draped, canonical = ([Mesh(p) for p in getattr(arguments, key)] for key in ("rest", "draped", "canonical"))
    if len(rests) != len(draped) or (canonical and len(canonical) != len(draped)):
        parser.error("--rest, --draped and --canonical need one file per garment each")
    result = score(Mesh(arguments.body), rests, draped, canonical)
    if not arguments.compare:
        print(json.dumps(result, indent=1))
    elif not compare(result, json.load(open(arguments.compare)), arguments.tolerance):
        sys.exit(1)


if __name__ == "__main__":
    main()
