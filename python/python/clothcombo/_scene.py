"""The eight energies with their gradients."""

import json

import numpy as np

from . import _native
from ._arrays import array, mesh, meshes, plain, positions as _positions, transforms as _rows
from ._errors import Error

TERMS = tuple(_native.TERMS)


def default_losses():
    """The table [losses] of a configuration that says nothing: weights, margins, switches, material."""
    return _native.default_losses()


class Scene:
    """Garments on a posed body, prepared once, whose energies and gradients are then evaluated at any positions.

    `garments`: rest meshes, innermost first, files or (positions [V, 3] (m), faces [F, 3]). `body`: the posed body, the same.
    `losses`: what differs from the table [losses] of a configuration, e.g. {"strain": {"weight": 2.0}, "repulsion":
    {"subset": 0}, "material": {"density": 300.0}}; the values are `default_losses()`. `held`: which garments the holding energy
    keeps up, against `references` (canonical positions without learned displacement; default: rest); it reads canonical
    positions, or, with `transforms` [ΣV, 3, 4] (initial skinning of every vertex), posed ones pulled back. `layers`: pairs (inner,
    outer); default: all. `materials`: what each garment is made of where that is not the losses' "material", e.g. [None,
    {"thickness": 0.003}]; garments are kept half their thickness off the body and each other where that is more than the margin.
    """

    def __init__(
        self, garments, body, *, losses=None, held=None, references=None, transforms=None, layers=None, materials=None,
        dtype=np.float32,
    ):
        garments = meshes(garments, "garment")
        held = [False] * len(garments) if held is None else [bool(x) for x in held]
        references = [None] * len(garments) if references is None else [
            None if x is None else _positions(x, f"reference {i}") for i, x in enumerate(references)
        ]
        self._native = _native.Scene(
            garments, mesh(body, "body"), held, references, _rows(transforms), layers, json.dumps(plain(losses or {})),
            json.dumps([plain(material or {}) for material in materials or []]),
            np.dtype(dtype) == np.float64,
        )
        self.vertex_counts = self._native.vertex_counts

    def on_body(self, vertices, transforms=None):
        """The same garments on another pose of the body, its vertices [B, 3] (m); they are not prepared anew."""
        scene = object.__new__(Scene)
        scene._native = self._native.on_body(_positions(vertices, "body"), _rows(transforms))
        scene.vertex_counts = self.vertex_counts
        return scene

    def __call__(self, positions, canonical=None, *, sample=0):
        """Energies and gradients at `positions` [ΣV, 3] (m), garment after garment, in float32 or float64 as they are.

        Returns a dictionary of the eight terms (J, m³, 1, m²; NaN for one without weight) and their weighted sum "total", and
        the gradient of the sum [ΣV, 3]; with `canonical` positions also the gradient there. `sample` numbers the random pairs
        that the repulsion takes unless {"repulsion": {"subset": 0}}.
        """
        (total, terms, gradient, of_canonical), = evaluate([self], [positions], [canonical], sample)
        energies = dict(zip(TERMS, terms.tolist()), total=total)
        return (energies, gradient) if canonical is None else (energies, gradient, of_canonical)

    def __repr__(self):
        return f"Scene({len(self.vertex_counts)} garments, {sum(self.vertex_counts)} vertices)"


def evaluate(scenes, positions, canonical, sample=0):
    """Total, terms [8], gradient [ΣV, 3] and gradient at canonical positions (or None) of every scene, in parallel.

    Arrays of float32 or float64, one precision for all; what is C-contiguous is read in place.
    """
    positions = [np.asarray(x) for x in positions]
    dtype = positions[0].dtype if positions else np.dtype(np.float32)
    native = {np.dtype(np.float32): _native.evaluate_f32, np.dtype(np.float64): _native.evaluate_f64}.get(dtype)
    if native is None:
        raise Error(f"positions of {dtype}; hint: float32 or float64")
    if not 0 <= sample < 2**32:
        raise Error(f"sample is {sample}; hint: a number from 0 to 2^32 - 1")
    posed = [array(x, "positions", (None, 3), dtype) for x in positions]
    canonical = [None if x is None else array(x, "canonical positions", (None, 3), dtype) for x in canonical]
    return native([scene._native for scene in scenes], posed, canonical, sample)
