"""Models, garments and drapes."""

import os
from functools import cached_property

from . import _native
from ._arrays import garment as _garment, motion as _motion, numbers, pose as _pose, positions as _positions
from ._body import Body
from ._errors import Error
from ._measure import TERMS_OF_SCORE


class Garment:
    """A garment with what is known about it; hints are found out where they are not given.

    `source` is a mesh file (OBJ, PLY, STL, glTF), the name of a built-in garment, or positions [V, 3] and faces [F, 3] or [F, 4].
    Hints as of `clothcombo fit`: `unit`, `up`, `arms`, `legs` (degrees), `category`, `offset` (m), `turn` (degrees), `keep`,
    `join_seams` ("5mm"), `from_body`. A garment with a hint is always fitted. `material` is a dict of `thickness` (m), `density`
    (kg/m³), `lambda`, `mu` (Pa) and `bending_stiffness` (J/rad²) where they are not those that the model was trained with: the
    refinement knows them, the networks only how thick the garments below are.
    """

    def __init__(self, source, name=None, **hints):
        self.source, self.name, self.hints = source, name, hints


class Model:
    """A trained model and the body it dresses; `garments` are the names it knows, `body` is the body."""

    def __init__(self, native):
        self._native = native

    @classmethod
    def load(cls, path=None, *, body=None, cache=None, folders=()):
        """The shipped model, or that of a run, a checkpoint or a model.safetensors.

        `body`: "mannequin" or an npz; default: the body the model was trained on. `cache`: folder that keeps embeddings; default:
        clothcombo in the user's cache folder; False keeps none. `folders` of garments that may be named.
        """
        kept = None if cache is None or cache is False else os.fspath(cache)
        body = None if body is None else os.fspath(body)
        return cls(_native.Model.load(None if path is None else os.fspath(path), body, kept, cache is False, [os.fspath(f) for f in folders]))

    @property
    def garments(self):
        return self._native.garments

    @property
    def folder(self):
        return self._native.folder

    @cached_property
    def body(self):
        return Body(self._native.body)

    def outfit(self, garments, *, order=None, fit="auto"):
        """Garments, innermost first, read, placed and embedded once, to be draped on many bodies.

        `garments`: (positions, faces) pairs, files, names, or `Garment`s. `order`: their numbers, innermost first. `fit`: "auto",
        "always" or "never".
        """
        chosen = {"auto": None, "always": True, "never": False}
        if fit not in chosen:
            raise Error(f"fit is {fit!r}; hint: auto, always or never")
        wanted = [_garment(x, i) for i, x in enumerate(garments)]
        if order is not None:
            if sorted(order) != list(range(len(wanted))):
                raise Error(f"order {list(order)} is no order of {len(wanted)} garments; hint: name each once, from 0")
            wanted = [wanted[i] for i in order]
        return Outfit(self._native.outfit(wanted, chosen[fit]))

    def drape(self, garments, *, order=None, fit="auto", **arguments):
        """Drapes garments, innermost first, as `clothcombo drape` does: `outfit(garments, …).drape(…)`."""
        return self.outfit(garments, order=order, fit=fit).drape(**arguments)

    def __repr__(self):
        return repr(self._native)


class Outfit:
    """Garments of a model, innermost first, ready to be draped; `names` are theirs."""

    def __init__(self, native):
        self._native = native
        self.names = native.names

    def drape(
        self, *, shape=(), pose=None, motion=None, frames=(0, None), every=1, posed=None, t_pose=None,
        refine=None, resolve=True, gap_mm=1.0, time_limit=None, smooth=None,
    ):
        """Drapes them on one body or on the frames of a motion.

        `shape`: parameters. `pose`: rotation vectors [J, 3] (radians), a name, or FILE.npz:FRAME; `motion`: a file, or (poses
        [T, J, 3], frames per second), of which `frames` (first, end) and `every` take a part; `posed`: the vertices [B, 3] of
        the posed body, whose shape is `shape` or that of the vertices `t_pose`. `refine` (at most 1000 steps or "auto"; by
        default 4 for one pose, 0 for a motion), `resolve`, `gap_mm`, `time_limit` (s for a garment) and `smooth` (frames) are the
        flags of that name.
        """
        if sum(x is not None for x in (pose, motion, posed)) > 1 or (t_pose is not None and posed is None):
            raise Error("more than one of pose, motion and posed, or t_pose without posed; hint: give one body")
        first, end = frames
        native = self._native.drape(
            numbers(shape, "shape"), _pose(pose), _motion(motion), (first, end), every,
            None if posed is None else _positions(posed, "posed"), None if t_pose is None else _positions(t_pose, "t_pose"),
            refine, resolve, gap_mm, time_limit, smooth,
        )
        return Drape(native)

    def __repr__(self):
        return f"Outfit({self.names})"


class DrapedGarment:
    """One garment of a drape. Of a motion, positions have the frames as their first dimension.

    `name`; `positions` [V, 3] (m) and `faces` [F, 3] in the order of the given mesh. The mesh that was draped, after repairs:
    `mesh_rest` [W, 3] on the zero body, `mesh_faces`, and per stage `skinned` (linear blend skinning), `network` and
    `mesh_positions` (the result); `transforms` [W, 3, 4] skin it in the first frame. `held`, `category`.
    """

    def __init__(self, native, index):
        self._native, self._index = native, index
        self.name = native.names[index]
        self.held, self.category = native.kind(index)

    def _frames(self, array):
        return array if self._native.is_motion else array[0]

    def _stage(self, name):
        return self._frames(self._native.stage(self._index, name))

    @cached_property
    def positions(self):
        return self._frames(self._native.given(self._index))

    @cached_property
    def faces(self):
        return self._native.given_faces(self._index)

    @cached_property
    def mesh_rest(self):
        return self._native.mesh(self._index)[0]

    @cached_property
    def mesh_faces(self):
        return self._native.mesh(self._index)[1]

    @cached_property
    def mesh_positions(self):
        return self._stage("positions")

    @cached_property
    def skinned(self):
        return self._stage("skinned")

    @cached_property
    def network(self):
        return self._stage("network")

    @cached_property
    def transforms(self):
        return self._native.transforms(self._index).reshape(-1, 3, 4)

    def __repr__(self):
        return f"DrapedGarment({self.name!r}, {self.positions.shape[-2]} vertices)"


class Drape:
    """An outfit on a body, or on every frame of a motion.

    `garments`; `body` [B, 3] (m) and `body_faces` [F, 3]; `certificate`, exact counts of what intersects in the result; of a
    motion, `seconds` of the frames, which are the first dimension of all positions.
    """

    def __init__(self, native):
        self._native = native
        self.is_motion, self.seconds = native.is_motion, native.seconds
        self.garments = [DrapedGarment(native, i) for i in range(len(native.names))]

    @cached_property
    def body(self):
        body = self._native.body()
        return body if self.is_motion else body[0]

    @cached_property
    def body_faces(self):
        return self._native.body_faces()

    @cached_property
    def certificate(self):
        return self._native.certificate()

    @cached_property
    def energies(self):
        """The energies in the paper's printed form, summed over garments and layers (J, m³, 1), in the first frame."""
        score = self.score()
        parts = [garment["raw"] for garment in score["garments"]] + score["layers"]
        return {term: sum(part.get(term, 0.0) for part in parts) for term in TERMS_OF_SCORE}

    def score(self, frame=0):
        """What `clothcombo score` says of a frame."""
        return self._native.score(frame)

    def report(self):
        """What `clothcombo drape` writes into report.json."""
        return self._native.report()

    def save(self, folder, *, replace=False, all_frames=False):
        """Writes what `clothcombo drape` writes: OBJ, scene.glb, pictures, viewer.html, report.json."""
        self._native.save(os.fspath(folder), replace, all_frames)

    def __repr__(self):
        return f"Drape({self.garments})"


def fit(garment, body):
    """Positions [V, 3] (m) and faces [F, 3] of a file, mesh or `Garment` at rest on the zero body of a `Body`, and the report:
    what `clothcombo fit` assumed, repaired and measured."""
    return _native.fit(_garment(garment, 0), body._native)
