"""Meshes from anywhere: checked, scored, counted, resolved. A mesh is a file, or a pair of positions [V, 3] (m) and faces."""

import os
from typing import NamedTuple

from . import _native
from ._arrays import is_path, mesh, meshes

TERMS_OF_SCORE = ("strain", "bending", "gravity", "body_collision", "repulsion", "layer_collision", "layer_distance")


def check(paths, *, body=None):
    """What `clothcombo check` finds in files and folders, a dictionary each; an unusable one says why under "unusable".

    Garments are measured on the zero body of `body` ("mannequin" or an npz); default: the one body among the files, else the
    mannequin.
    """
    paths = [paths] if is_path(paths) else paths
    return _native.check([os.fspath(path) for path in paths], None if body is None else os.fspath(body))


def score(body, rest, draped, *, canonical=(), surface=False):
    """What `clothcombo score` says of draped meshes, innermost first: energies in the paper's printed form, penetration, exact
    intersections, layer order. `canonical` meshes, before skinning, add the holding energy; with `surface` distances are to the
    closest point of the body's surface instead of its nearest vertex."""
    return _native.score(
        mesh(body, "body"), meshes(rest, "rest"), meshes(draped, "garment"), meshes(canonical, "canonical"), surface
    )


def certificate(body, garments, *, rest=()):
    """Exact counts of what intersects what: posed body and draped garments, innermost first; `rest` meshes for strain."""
    return _native.certificate(mesh(body, "body"), meshes(garments, "garment"), meshes(rest, "rest"))


class Resolved(NamedTuple):
    """Positions [V, 3] (m) of every garment, and the certificate of what still intersects."""

    positions: list
    certificate: dict


def resolve(body, garments, *, rest=(), gap_mm=1.0, time_limit=None, keep_self=False):
    """Takes draped garments, innermost first, out of the body and out of each other, as `clothcombo resolve` does."""
    return Resolved(*_native.resolve(
        mesh(body, "body"), meshes(garments, "garment"), meshes(rest, "rest"), gap_mm, time_limit, keep_self
    ))
