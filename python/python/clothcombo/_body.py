"""A parametric body."""

import os

from . import _native
from ._arrays import numbers, pose as _pose


class Body:
    """A parametric body with linear blend skinning; its pelvis is at the origin.

    Attributes: `name`; `faces` [F, 3]; `joint_names` and `parents` of the J joints; `shape_count`.
    """

    def __init__(self, native):
        self._native = native
        self.name, self.faces = native.name, native.faces
        self.joint_names, self.parents, self.shape_count = native.joint_names, native.parents, native.shape_count

    @classmethod
    def load(cls, name="mannequin"):
        """"mannequin", or an npz file: SMPL, SMPL-H, SMPL-X, or one that `clothcombo import` wrote."""
        return cls(_native.Body.load(os.fspath(name)))

    def __call__(self, shape=(), pose=None):
        """Vertices [V, 3] and joints [J, 3] (m) of `shape` (parameters, missing ones are 0) in `pose` (rotation vectors [J, 3]
        in radians, a name, or FILE.npz:FRAME; default: T-pose)."""
        vertices, joints, _ = self.posed(shape, pose)
        return vertices, joints

    def posed(self, shape=(), pose=None):
        """The same, and the transforms of the bones [J, 3, 4] from the shaped T-pose."""
        pose = _pose([[0.0] * 3] if pose is None else pose)
        vertices, joints, bones = self._native.posed(numbers(shape, "shape"), pose)
        return vertices, joints, bones.reshape(-1, 3, 4)

    def __repr__(self):
        return repr(self._native)
