"""Arguments as the native module takes them: C-contiguous arrays, and names for what has none."""

import json
import os

import numpy as np

from ._errors import Error


def on_host(x):
    """A tensor of PyTorch as an array, on the CPU in place; anything else as it is."""
    if hasattr(x, "detach"):
        if x.requires_grad:
            raise Error(
                "a tensor that requires grad, but there are gradients with respect to garment positions only; hint: x.detach()"
            )
        return x.detach().cpu().numpy()
    return x


def array(x, what, shape, dtype=np.float64):
    """`x` as a C-contiguous array whose dimensions are those of `shape`, None for any."""
    try:
        x = np.asarray(on_host(x))
    except (TypeError, ValueError) as error:
        raise Error(f"{what}: {error}") from None
    if x.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, x.shape)):
        expected = ", ".join("N" if n is None else str(n) for n in shape)
        raise Error(f"{what}: an array of shape {list(x.shape)}; hint: its shape is [{expected}]")
    if x.dtype.kind not in "fiu" or (np.dtype(dtype).kind == "u" and x.dtype.kind == "f"):
        kind = "whole numbers" if np.dtype(dtype).kind == "u" else "numbers"
        raise Error(f"{what}: an array of {x.dtype}; hint: {kind} are expected")
    if np.dtype(dtype).kind == "u" and x.size and (x.min() < 0 or x.max() > np.iinfo(dtype).max):
        raise Error(f"{what}: an index of {x.min() if x.min() < 0 else x.max()}; hint: vertices are counted from 0")
    return np.ascontiguousarray(x, dtype)


def positions(x, what):
    """Positions [V, 3] (m)."""
    return array(x, what, (None, 3))


def is_path(x):
    return isinstance(x, (str, os.PathLike))


def mesh(x, what):
    """A file, or positions [V, 3] (m) and faces [F, 3] or [F, 4]."""
    if is_path(x):
        return os.fspath(x)
    try:
        vertices, faces = x
    except (TypeError, ValueError):
        raise Error(f"{what}: neither a mesh file nor a pair of positions and faces") from None
    corners = 4 if np.shape(faces)[-1:] == (4,) else 3
    faces = array(faces, f"{what}, faces", (None, corners), np.uint32)
    return positions(vertices, f"{what}, positions"), faces


def meshes(xs, what):
    return [mesh(x, f"{what} {i}") for i, x in enumerate(xs)]


def transforms(x):
    """Transforms [V, 3, 4] as rows, or None."""
    return None if x is None else array(x, "transforms", (None, 3, 4)).reshape(-1, 12)


def garment(x, number):
    """Name, mesh, and hints as JSON of a file, a name, a pair of arrays, or a `Garment` of these."""
    from . import Garment

    given = x if isinstance(x, Garment) else Garment(x)
    name = given.name or f"garment_{number}"
    if is_path(given.source):
        name = os.fspath(given.source)
    source = mesh(given.source, name)
    hints = {key: plain(value) for key, value in given.hints.items() if value is not None}
    return name, source, json.dumps({"file": name, **hints})


def plain(x):
    """A value as JSON has it."""
    if isinstance(x, os.PathLike):
        return os.fspath(x)
    if isinstance(x, dict):
        return {key: plain(value) for key, value in x.items()}
    x = on_host(x)
    return x.tolist() if hasattr(x, "tolist") else x


def pose(x):
    """A name, FILE.npz:FRAME, or rotation vectors [J, 3] (radians)."""
    if x is None or is_path(x):
        return None if x is None else os.fspath(x)
    x = np.asarray(on_host(x))
    return array(x.reshape(-1, 3) if x.ndim == 1 and x.size % 3 == 0 else x, "pose", (None, 3))


def motion(x):
    """A file, or poses [T, J, 3] (radians) and their rate (frames/s)."""
    if x is None or is_path(x):
        return None if x is None else os.fspath(x)
    try:
        poses, rate = x
        rate = float(rate)
    except (TypeError, ValueError):
        raise Error("motion: neither a file nor a pair of poses [T, J, 3] and a frame rate") from None
    poses = np.asarray(on_host(poses))
    if poses.ndim == 2 and poses.shape[1] % 3 == 0:
        poses = poses.reshape(len(poses), -1, 3)
    return array(poses, "motion, poses", (None, None, 3)), rate


def numbers(x, what):
    """A list of numbers."""
    return array(np.atleast_1d(on_host(x)), what, (None,)).tolist()
