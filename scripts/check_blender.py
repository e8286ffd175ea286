#!/usr/bin/env python3
"""Reads a drape with a motion into Blender and compares what moves there with the point caches.

usage: scripts/check_blender.py OUT

OUT is the folder of `clothcombo drape --motion …`. Needs `pip install bpy` (0.4 GB). Checks docs/blender.py (every OBJ with its PC2
cache as a modifier) and scene.glb (morph targets) in the first, the middle and the last frame: vertices within 10⁻⁵ m of the cache.
"""
import pathlib
import runpy
import sys

if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
    print(__doc__)
    sys.exit(0 if len(sys.argv) == 2 else 2)

import bpy
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
TOLERANCE = 1e-5


def point_cache(path):
    """Frames [T, V, 3] of a PC2 file, in the file's axes (m)."""
    data = path.read_bytes()
    assert data[:12] == b"POINTCACHE2\0", path
    vertices, frames = np.frombuffer(data, "<i4", 1, 16)[0], np.frombuffer(data, "<i4", 1, 28)[0]
    return np.frombuffer(data, "<f4", offset=32).reshape(frames, vertices, 3).astype(float)


def shown(mesh, frame):
    """Vertices of an object as Blender shows them in a frame, in its own axes."""
    whole = int(np.floor(frame))
    bpy.context.scene.frame_set(whole, subframe=frame - whole)
    evaluated = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    positions = np.empty(3 * len(evaluated.vertices))
    evaluated.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def check(what, name, distance):
    print(f"{what}: {name}, farthest vertex {distance:.2e} m")
    assert distance <= TOLERANCE, f"{what}: {name} is {distance} m from its point cache"


def main():
    folder = pathlib.Path(sys.argv[1])
    caches = {path.stem: point_cache(path) for path in sorted(folder.glob("*.pc2"))}
    assert caches, f"{folder} holds no point cache; drape a motion"

    bpy.ops.wm.read_factory_settings(use_empty=True)
    sys.argv = ["blender.py", "--", str(folder)]
    runpy.run_path(str(ROOT / "docs" / "blender.py"))
    meshes = {mesh.name: mesh for mesh in bpy.data.objects if mesh.type == "MESH"}
    for name, frames in caches.items():
        looked_at = sorted({0, len(frames) // 2, len(frames) - 1})
        check("cache", name, max(np.abs(shown(meshes[name], f) - frames[f]).max() for f in looked_at))

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(folder / "scene.glb"))
    meshes = {mesh.name: mesh for mesh in bpy.data.objects if mesh.type == "MESH"}
    for name, frames in caches.items():
        mesh = meshes[name]
        curves = mesh.data.shape_keys.animation_data.action.fcurves
        times = sorted({key.co.x for curve in curves for key in curve.keyframe_points})
        assert len(times) == len(frames), f"{name}: {len(times)} keys for {len(frames)} frames"
        # glTF's y up is Blender's z up; seams of the texture make two vertices of one.
        turned = lambda positions: np.stack([positions[:, 0], -positions[:, 2], positions[:, 1]], 1)
        first = shown(mesh, times[0])
        of_file = turned(frames[0])
        same = [int(np.argmin(((of_file - p) ** 2).sum(1))) for p in first]
        looked_at = sorted({0, len(frames) // 2, len(frames) - 1})
        check("glTF", name, max(np.abs(shown(mesh, times[f]) - turned(frames[f])[same]).max() for f in looked_at))
    print("Blender shows what was written")


main()
