#!/usr/bin/env python3
"""Converts an SMPL model pickle (Python 2, with chumpy and scipy arrays) to the npz that `clothcombo import smplx` reads.

usage: scripts/smpl_pickle_to_npz.py basicModel_neutral_lbs_10_207_0_v1.0.0.pkl smpl_neutral.npz

Needs numpy only. A pickle is a program; this one is not trusted: of all the names it asks for, only numpy's array
constructors are real; chumpy's and scipy's classes are replaced by empty stand-ins that hold what the pickle puts into
them, and everything else is refused by name.
"""
import os
import pickle
import sys

import numpy as np

try:
    from numpy._core import multiarray, numeric
except ImportError:  # numpy before 2.0
    from numpy.core import multiarray, numeric

KEYS = ("v_template", "f", "shapedirs", "posedirs", "J_regressor", "weights", "kintree_table")


class Held:
    """Takes any constructor arguments and any state, and does nothing with them."""

    # Some pickles make objects without calling __init__.
    state = {}

    def __init__(self, *_arguments, **_keywords):
        self.state = {}

    def __setstate__(self, state):
        self.state = state if isinstance(state, dict) else {"state": state}


def stand_in(module, name):
    return type(name, (Held,), {"__module__": "stand_in." + module})


def encode(text, encoding="latin1", *_):
    """Python 3 pickles bytes of protocol 2 through this."""
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1", "ascii", "utf-8"):
        raise pickle.UnpicklingError("unexpected use of _codecs.encode")
    return text.encode(encoding)


def reconstructed(kind, cls, *arguments):
    """copyreg._reconstructor for stand-ins only."""
    if not (isinstance(kind, type) and issubclass(kind, Held)):
        raise pickle.UnpicklingError("refused: it would build an object of %r" % (kind,))
    return kind()


ARRAYS = {
    "_reconstruct": multiarray._reconstruct,
    "scalar": multiarray.scalar,
}
REAL = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    ("_codecs", "encode"): encode,
    ("copy_reg", "_reconstructor"): reconstructed,
    ("copyreg", "_reconstructor"): reconstructed,
    ("__builtin__", "object"): object,
    ("builtins", "object"): object,
}
# Arrays of protocol 5.
REAL |= {(module, "_frombuffer"): numeric._frombuffer for module in ("numpy.core.numeric", "numpy._core.numeric")}
MULTIARRAY = ("numpy.core.multiarray", "numpy._core.multiarray")
STAND_INS = ("chumpy", "scipy.sparse")


class Restricted(pickle.Unpickler):
    def find_class(self, module, name):
        if module in MULTIARRAY and name in ARRAYS:
            return ARRAYS[name]
        if (module, name) in REAL:
            return REAL[module, name]
        if any(module == root or module.startswith(root + ".") for root in STAND_INS):
            return stand_in(module, name)
        raise pickle.UnpicklingError("refused: the pickle asks for %s.%s, which neither an SMPL model nor a motion needs" % (module, name))


def text(key):
    return key.decode("latin1") if isinstance(key, bytes) else key


def array(key, value):
    """A numpy array from what the unpickler made of a numpy, chumpy or scipy array."""
    if isinstance(value, np.ndarray):
        if value.dtype == object:
            raise SystemExit("key '%s' is an array of objects" % key)
        return value
    if isinstance(value, Held):
        state = {text(k): v for k, v in value.state.items()}
        # chumpy.Ch keeps its numbers in x; chumpy's selections keep the array they select from.
        if "x" in state:
            return array(key, state["x"])
        if "a" in state and "idxs" in state:
            flat = array(key, state["a"]).ravel()[array(key, state["idxs"]).astype(int)]
            shape = state.get("preferred_shape")
            return flat.reshape(tuple(int(n) for n in shape)) if shape is not None else flat
        # Compressed sparse columns or rows.
        if all(k in state for k in ("data", "indices", "indptr")):
            return dense(key, type(value).__name__, state)
        raise SystemExit("key '%s' is a %s with unknown contents: %s" % (key, type(value).__name__, ", ".join(sorted(state)) or "none"))
    if isinstance(value, (list, tuple, int, float)):
        return np.asarray(value)
    raise SystemExit("key '%s' is a %s, not an array" % (key, type(value).__name__))


def dense(key, kind, state):
    shape = state.get("_shape", state.get("shape"))
    if shape is None or not kind.startswith(("csc", "csr")):
        raise SystemExit("key '%s' is a sparse %s, expected csc or csr with a shape" % (key, kind))
    rows, columns = (int(n) for n in shape)
    data, indices, pointers = (np.asarray(state[k]) for k in ("data", "indices", "indptr"))
    major = columns if kind.startswith("csc") else rows
    if len(pointers) != major + 1:
        raise SystemExit("key '%s': %d pointers for shape %s" % (key, len(pointers), (rows, columns)))
    along = np.repeat(np.arange(major), np.diff(pointers))
    out = np.zeros((rows, columns))
    at = (indices, along) if kind.startswith("csc") else (along, indices)
    np.add.at(out, at, data)
    return out


def main():
    if len(sys.argv) != 3 or sys.argv[1] in ("-h", "--help"):
        print(__doc__.strip())
        return 0 if sys.argv[1:2] in (["-h"], ["--help"]) else 2
    source, target = sys.argv[1:]
    try:
        with open(source, "rb") as f:
            model = Restricted(f, encoding="latin1").load()
    except (OSError, pickle.UnpicklingError, EOFError, ValueError, TypeError, AttributeError, KeyError, IndexError, ImportError) as e:
        print("%s: %s" % (source, e), file=sys.stderr)
        return 1
    if not isinstance(model, dict):
        print("%s: holds a %s, not a model" % (source, type(model).__name__), file=sys.stderr)
        return 1
    model = {text(k): v for k, v in model.items()}
    missing = [k for k in KEYS if k not in model]
    if missing:
        print("%s: no %s; keys present: %s" % (source, ", ".join(missing), ", ".join(sorted(model))), file=sys.stderr)
        return 1
    arrays = {k: np.ascontiguousarray(array(k, model[k])) for k in KEYS}
    temporary = target + ".tmp.npz"
    np.savez_compressed(temporary, **arrays)
    os.replace(temporary, target)
    for k in KEYS:
        print("%-14s %s %s" % (k, arrays[k].shape, arrays[k].dtype))
    print("left out: %s" % (", ".join(sorted(k for k in model if k not in KEYS)) or "nothing"))
    print("wrote %s; next: clothcombo import smplx %s -o body.npz" % (target, target))
    return 0


if __name__ == "__main__":
    sys.exit(main())
