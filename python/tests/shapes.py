"""Meshes for tests: a body and sleeves around it, as numpy arrays."""

import numpy as np


def tube(radius, height, around=16, along=12, wave=0.0):
    """An open tube about the y axis: positions [V, 3] (m), faces [F, 3]; `wave` bends its radius."""
    angle = 2 * np.pi * np.arange(around) / around
    y = np.linspace(-height / 2, height / 2, along)
    r = radius * (1 + wave * np.sin(5 * angle[None] + 9 * y[:, None]))
    x = np.stack([r * np.cos(angle), np.broadcast_to(y[:, None], r.shape), r * np.sin(angle)], -1).reshape(-1, 3)
    i, j = (k.ravel() for k in np.mgrid[: along - 1, :around])
    a, b = i * around + j, i * around + (j + 1) % around
    return x, np.concatenate([np.stack([a, a + around, b], 1), np.stack([b, a + around, b + around], 1)])


def closed_tube(radius, height, around=16, along=12):
    """The same with both ends closed by fans."""
    x, f = tube(radius, height, around, along)
    n, ends = len(x), []
    for start, middle, turn in ((0, n, 1), (n - around, n + 1, -1)):
        ring = start + np.arange(around)
        ends.append(np.stack([ring, np.roll(ring, -1), np.full(around, middle)], 1)[:, ::turn])
    return np.vstack([x, [[0, -height / 2, 0], [0, height / 2, 0]]]), np.vstack([f, *ends])
