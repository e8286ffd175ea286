#!/usr/bin/env python3
"""Checks scripts/smpl_pickle_to_npz.py on pickles made as SMPL's are, and on ones that would do harm; and motion_pickle_to_npz.py
on motions as three sources pickle them.

usage: scripts/check_smpl_pickle.py

Needs numpy and scipy. chumpy is played by a module of that name made here, and pickles are written with protocol 2 and the
module names of Python 2.
"""
import os
import pickle
import subprocess
import sys
import tempfile
import types

import numpy as np
import scipy.sparse

SCRIPTS = os.path.dirname(os.path.abspath(__file__))
CONVERTER = os.path.join(SCRIPTS, "smpl_pickle_to_npz.py")


def fake_module(name, **classes):
    module = types.ModuleType(name)
    for cls_name, cls in classes.items():
        cls.__module__, cls.__qualname__ = name, cls_name
        setattr(module, cls_name, cls)
    sys.modules[name] = module
    return module


class Ch:
    pass


class Select:
    pass


class csc_matrix:
    pass


class OldStyle(pickle._Pickler):
    """Writes the names Python 2 knew."""

    def save_global(self, obj, name=None):
        renamed = {"numpy._core.multiarray": "numpy.core.multiarray", "copyreg": "copy_reg", "builtins": "__builtin__"}
        module, name = getattr(obj, "__module__", None), name or obj.__qualname__
        self.write(b"c" + renamed.get(module, module).encode() + b"\n" + name.encode() + b"\n")
        self.memoize(obj)


def check_motions(folder):
    poses, trans = rng(7, 72), rng(7, 3)
    several = {"poses": [poses, poses[:5]], "trans": [trans, trans[:5]], "sequence": "street", "genders": ["m", "f"]}
    simulated = {"a/walk": {"pose_aa": poses, "trans_orig": trans, "fps": 30}, "b/run": {"pose_aa": poses[:4], "fps": 60.0}}
    for name, content, expected in [
        ("one", {"smpl_poses": poses, "smpl_trans": trans, "smpl_scaling": np.ones(1)}, {"": ("smpl_poses", 7, None)}),
        ("several", several, {"_0": ("poses", 7, None), "_1": ("poses", 5, None)}),
        ("simulated", simulated, {"_walk": ("poses", 7, 30), "_run": ("poses", 4, 60)}),
    ]:
        source, target = os.path.join(folder, name + ".pkl"), os.path.join(folder, name + ".npz")
        with open(source, "wb") as f:
            pickle.dump(content, f, 5 if name == "simulated" else 2)
        result = subprocess.run([sys.executable, os.path.join(SCRIPTS, "motion_pickle_to_npz.py"), source, target], capture_output=True, text=True)
        assert result.returncode == 0, result.stderr
        for part, (key, frames, rate) in expected.items():
            with np.load(os.path.join(folder, name + part + ".npz"), allow_pickle=False) as found:
                assert (found[key] == poses[:frames]).all() and (rate is None or found["fps"] == rate), (name, part)
    result = subprocess.run([sys.executable, os.path.join(SCRIPTS, "motion_pickle_to_npz.py"), CONVERTER, target], capture_output=True, text=True)
    assert result.returncode == 1 and "Traceback" not in result.stderr, result
    print("motions of three sources: exact")


def rng(*shape):
    return np.random.default_rng(2).normal(size=shape)


def main():
    fake_module("chumpy")
    fake_module("chumpy.ch", Ch=Ch)
    fake_module("chumpy.reordering", Select=Select)
    fake_module("scipy.sparse.csc", csc_matrix=csc_matrix)
    rng = np.random.default_rng(1)
    arrays = {
        "v_template": rng.normal(size=(12, 3)), "f": rng.integers(0, 12, (20, 3)).astype(np.uint32),
        "shapedirs": rng.normal(size=(12, 3, 10)), "posedirs": np.asfortranarray(rng.normal(size=(12, 3, 207))),
        "J_regressor": rng.normal(size=(24, 12)) * (rng.random((24, 12)) < 0.3), "weights": rng.random((12, 24)),
        "kintree_table": np.arange(48).reshape(2, 24).astype(np.uint32),
    }

    def chumpy(cls, **state):
        held = cls()
        held.__dict__.update(state)
        return held

    sparse = scipy.sparse.csc_matrix(arrays["J_regressor"])
    order = rng.permutation(360)
    shuffled = np.empty(360)
    shuffled[order] = arrays["shapedirs"].ravel()
    model = dict(
        arrays, J_regressor=chumpy(csc_matrix, _shape=(24, 12), data=sparse.data, indices=sparse.indices, indptr=sparse.indptr, maxprint=50),
        v_template=chumpy(Ch, x=arrays["v_template"], _status="new"), bs_style="lbs", J=np.zeros((24, 3)),
        shapedirs=chumpy(Select, a=chumpy(Ch, x=shuffled), idxs=order, preferred_shape=(12, 3, 10)))
    with tempfile.TemporaryDirectory() as folder:
        source, target = os.path.join(folder, "smpl.pkl"), os.path.join(folder, "smpl.npz")

        def convert(write):
            with open(source, "wb") as f:
                write(f)
            return subprocess.run([sys.executable, CONVERTER, source, target], capture_output=True, text=True)

        result = convert(lambda f: OldStyle(f, 2).dump(model))
        assert result.returncode == 0, result.stderr
        with np.load(target, allow_pickle=False) as found:
            for key, value in arrays.items():
                assert found[key].shape == value.shape and (found[key] == value).all(), key
        os.remove(target)
        print("a model with chumpy and scipy arrays: exact")

        mark = os.path.join(folder, "executed")
        for name, program in (("os.system", b"cos\nsystem\n(S'touch %s'\ntR." % mark.encode()),
                              ("builtins.eval", b"c__builtin__\neval\n(S'open(%r, \"w\")'\ntR." % mark.encode()),
                              ("subprocess.Popen", b"csubprocess\nPopen\n((lS'touch'\naS'%s'\natR." % mark.encode()),
                              ("numpy.load", b"cnumpy\nload\n(S'x'\ntR."), ("_reconstructor", b"ccopy_reg\n_reconstructor\n(c__builtin__\nobject\nc__builtin__\nobject\nNtR.")):
            result = convert(lambda f: f.write(program))
            assert result.returncode == 1 and "refused" in result.stderr, (name, result)
            assert not os.path.exists(mark) and not os.path.exists(target), name
        print("five pickles that would do harm: refused, nothing executed")
        for what, data in (("empty", b""), ("text", b"hello"), ("cut", pickle.dumps(arrays, 2)[:500]), ("list", pickle.dumps([1], 2)),
                           ("incomplete", pickle.dumps({"f": 1}, 2))):
            result = convert(lambda f: f.write(data))
            assert result.returncode == 1 and "smpl.pkl" in result.stderr and "Traceback" not in result.stderr, (what, result)
        print("five damaged files: a sentence each")
        check_motions(folder)


if __name__ == "__main__":
    main()
