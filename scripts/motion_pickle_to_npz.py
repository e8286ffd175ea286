#!/usr/bin/env python3
"""Converts a pickled motion (AIST++, 3DPW, AMASS for simulators, …) to npz files that `clothcombo import amass` and drape read.

usage: scripts/motion_pickle_to_npz.py MOTION.pkl motion.npz

Needs numpy only. Nothing of the pickle is executed (see smpl_pickle_to_npz.py). Its arrays, numbers and texts keep their names;
a pickle of several motions, or of several persons, makes motion_NAME.npz of each. Where no frame rate is said, say it with
`clothcombo import amass motion.npz --rate HZ`.
"""
import os
import pickle
import sys

import numpy as np

from smpl_pickle_to_npz import Held, Restricted, array, text

# Other names of the same arrays.
NAMES = {"pose_aa": "poses", "pose": "poses", "thetas": "poses", "trans_orig": "trans", "smpl_trans": "trans", "beta": "betas"}
POSES = ("poses", "full_pose", "fullpose", "smpl_poses", "body_pose", "pose_body")


def plain(key, value):
    """The value as an array of numbers or texts; None for what is neither."""
    if isinstance(value, (str, bytes)):
        return np.asarray(text(value))
    if isinstance(value, (list, tuple)) and not all(isinstance(x, (int, float)) for x in value):
        return None
    if not isinstance(value, (np.ndarray, np.generic, Held, list, tuple, int, float)):
        return None
    found = value if isinstance(value, np.generic) else array(key, value)
    return np.asarray(found) if np.asarray(found).dtype.kind in "biufUS" else None


def motions(content, name=""):
    """(name, arrays) of every motion in what was pickled."""
    if isinstance(content, (list, tuple)):
        content = dict(enumerate(content))
    if not isinstance(content, dict):
        return
    items = {str(text(key)): value for key, value in content.items()}
    named = {NAMES.get(key, key) if NAMES.get(key) not in items else key: value for key, value in items.items()}
    poses = next((named[key] for key in POSES if key in named), None)
    if isinstance(poses, (list, tuple)) and poses and isinstance(poses[0], np.ndarray) and poses[0].ndim == 2:
        # Several persons: what has one entry for each is theirs, the rest is everybody's.
        of = lambda value, i: value[i] if isinstance(value, (list, tuple)) and len(value) == len(poses) else value
        for i in range(len(poses)):
            yield from motions({key: of(value, i) for key, value in named.items()}, f"{name}_{i}")
    elif poses is not None:
        yield name, {key: found for key, value in named.items() if (found := plain(key, value)) is not None}
    else:
        for key, value in items.items():
            if isinstance(value, dict):
                yield from motions(value, f"{name}_{os.path.basename(key)}")


def main():
    if len(sys.argv) != 3 or sys.argv[1] in ("-h", "--help"):
        print(__doc__.strip())
        return 0 if sys.argv[1:2] in (["-h"], ["--help"]) else 2
    source, target = sys.argv[1], sys.argv[2].removesuffix(".npz")
    try:
        with open(source, "rb") as file:
            found = list(motions(Restricted(file, encoding="latin1").load()))
    except (OSError, pickle.UnpicklingError, EOFError, ValueError, TypeError, AttributeError, KeyError, IndexError, ImportError) as e:
        print(f"{source}: {e}", file=sys.stderr)
        return 1
    if not found:
        print(f"{source}: holds no poses ({', '.join(POSES)}); of a body model: smpl_pickle_to_npz.py", file=sys.stderr)
        return 1
    for name, arrays in found:
        path = f"{target}{name if len(found) > 1 else ''}.npz"
        np.savez_compressed(f"{path}.tmp.npz", **arrays)
        os.replace(f"{path}.tmp.npz", path)
        print(f"wrote {path}: " + ", ".join(f"{key} {list(value.shape)}" for key, value in arrays.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
