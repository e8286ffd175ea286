"""The losses in PyTorch, as a paper's authors would write them on a CPU: dense pairwise distances (torch.cdist), gathers over
faces and hinges, gradients by autograd, f32. Everything that positions do not change is computed beforehand, as in ours.

cdist's default, a matrix product, is faster than the exact form, although in f32 it is off by up to 0.3 mm and now and then
takes a neighbour for the nearest vertex. Bending is the printed one, which ours leaves where a triangle collapses to less than
a twentieth of its area. `set_exact(True)` switches both to ours, to compare values and gradients; timed are the authors' forms.
"""

import math

import numpy as np
import torch

from exported_scene import SETTINGS

EXACT = "donot_use_mm_for_euclid_dist"
_mode = "use_mm_for_euclid_dist_if_necessary"
_device = "cpu"


def set_exact(exact):
    global _mode
    _mode = EXACT if exact else "use_mm_for_euclid_dist_if_necessary"


def set_device(device):
    """Where everything made from here on lies."""
    global _device
    _device = device


def narrow(array):
    return torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(_device)


def indices(array):
    return torch.from_numpy(np.ascontiguousarray(array, np.int64)).to(_device)


def normals(x, faces):
    a, b, c = (x[faces[:, k]] for k in range(3))
    summed = torch.zeros_like(x).index_add(0, faces.T.ravel(), torch.linalg.cross(b - a, c - a).repeat(3, 1))
    return summed / summed.norm(dim=1, keepdim=True).clamp_min(1e-20)


class Body:
    """A posed body: positions [B,3], faces [F,3]."""

    def __init__(self, positions, faces):
        self.positions = narrow(positions)
        self.normals = normals(self.positions, indices(faces))

    def gaps(self, x):
        """Signed distance of every point along the normal of the nearest body vertex, and that vertex."""
        with torch.no_grad():
            nearest = torch.cdist(x, self.positions, compute_mode=_mode).argmin(1)
        return ((x - self.positions[nearest]) * self.normals[nearest]).sum(1), nearest


class Garment:
    """Losses of one garment with rest positions [V,3] (f64) and faces [F,3]; held at `reference` [V,3]."""

    def __init__(self, rest, faces, reference, settings=SETTINGS):
        self.settings = settings
        faces = faces.astype(np.int64)
        self.count = count = len(rest)
        self.faces = indices(faces)
        self.identity = torch.eye(2, device=_device)
        a, b, c = (rest[faces[:, k]] for k in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        first = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
        up = (c - a) - np.sum((c - a) * first, 1)[:, None] * first
        second = up / np.linalg.norm(up, axis=1)[:, None]
        edges = np.zeros((len(faces), 2, 2))
        edges[:, 0, 0] = np.sum((b - a) * first, 1)
        edges[:, 0, 1] = np.sum((c - a) * first, 1)
        edges[:, 1, 1] = np.sum((c - a) * second, 1)
        self.inverse = narrow(np.linalg.inv(edges))
        self.volume = narrow(area * settings["thickness"])
        mass = np.zeros(count)
        np.add.at(mass, faces.ravel(), np.repeat(area * settings["thickness"] * settings["density"] / 3, 3))
        self.weight = narrow(mass * settings["gravity"])

        # Half-edges face by face, each with the vertex opposite; an edge of two faces, its lower vertex first, is a hinge.
        p, q, opposite = faces.ravel(), np.roll(faces, -1, 1).ravel(), np.roll(faces, -2, 1).ravel()
        half, twin = p * count + q, q * count + p
        order = np.argsort(half)
        place = order[np.searchsorted(half, twin, sorter=order).clip(max=len(half) - 1)]
        inner = (half[place] == twin) & (p < q)
        self.hinges = indices(np.stack([p, q, opposite, opposite[place]], 1)[inner])
        pairs = np.stack([p, q], 1)
        apart = torch.ones((count, count), dtype=torch.bool, device=_device)
        i, j = indices(p), indices(q)
        apart[i, j] = False
        apart[j, i] = False
        apart.fill_diagonal_(False)
        self.apart = apart
        unique = np.unique(np.sort(pairs, axis=1), axis=0)
        lengths = np.sort(np.linalg.norm(rest[unique[:, 0]] - rest[unique[:, 1]], axis=1))
        self.median_edge = float(lengths[len(lengths) // 2])
        a, b, c, d = (rest[self.hinges[:, k].cpu().numpy()] for k in range(4))
        doubled = [np.linalg.norm(np.cross(b - a, e - a), axis=1) for e in (c, d)]
        self.collapse = narrow(np.maximum(0.05 * np.stack(doubled), 1e-3 * self.median_edge**2))
        held = np.argsort(-rest[:, 1], kind="stable")[: math.ceil(settings["holding_fraction"] * count - 1e-9)]
        self.held = indices(held)
        self.reference = narrow(reference)
        self.rows = None

    def pull_back(self, weights, bones):
        """Heights are read off posed positions from here on, undone by the initial skinning [V,J] of bones [J,3,4]."""
        blended = np.einsum("vj,jab->vab", weights.astype(np.float64), bones.astype(np.float64))
        held = self.held.cpu().numpy()
        linear = blended[held, :, :3]
        is_flat = np.abs(np.linalg.det(linear)) < 0.05
        linear[is_flat] = np.eye(3)
        row = np.linalg.inv(linear)[:, 1, :]
        shift = -(row * blended[held, :, 3]).sum(1)
        self.held = indices(held[~is_flat])
        self.rows = narrow(np.concatenate([row, shift[:, None]], axis=1)[~is_flat])

    def strain(self, x):
        a, b, c = (x[self.faces[:, k]] for k in range(3))
        f = torch.stack([b - a, c - a], dim=2) @ self.inverse
        g = 0.5 * (f.transpose(1, 2) @ f - self.identity)
        trace = g[:, 0, 0] + g[:, 1, 1]
        return (self.volume * (0.5 * self.settings["lambda"] * trace**2 + self.settings["mu"] * (g * g).sum((1, 2)))).sum()

    def bending(self, x):
        a, b, c, d = (x[self.hinges[:, k]] for k in range(4))
        n1, n2 = torch.linalg.cross(b - a, c - a), torch.linalg.cross(d - a, b - a)
        edge = (b - a) / (b - a).norm(dim=1, keepdim=True)
        angle = torch.atan2((torch.linalg.cross(n1, n2) * edge).sum(1), (n1 * n2).sum(1))
        energy = angle**2
        if _mode == EXACT:
            for n, collapse in zip((n1, n2), self.collapse):
                t = ((n / collapse[:, None]) ** 2).sum(1).clamp(max=1)
                energy = energy * t**2 * (6 - 8 * t + 3 * t**2)
        return 0.5 * self.settings["bending_stiffness"] * energy.sum()

    def gravity(self, x):
        return (self.weight * x[:, 1]).sum()

    def body_collision(self, x, body):
        return (torch.relu(self.settings["body_epsilon"] - body.gaps(x)[0]) ** 3).sum()

    def repulsion(self, x):
        distance = torch.cdist(x, x, compute_mode=_mode)
        close = (distance < self.settings["radius"]) & self.apart
        pairs = -torch.log(torch.where(close, distance, distance.new_ones(())) ** 2).sum() / 2
        return pairs / self.count if self.settings["repulsion_per_vertex"] else pairs

    def holding(self, x, y):
        height = y[self.held, 1] if self.rows is None else (self.rows[:, :3] * x[self.held]).sum(1) + self.rows[:, 3]
        return ((height - self.reference[self.held, 1]) ** 2).sum()

    def term(self, name, x, y, body):
        """One term at posed positions x and canonical positions y."""
        if name == "holding":
            return self.holding(x, y)
        return self.body_collision(x, body) if name == "body_collision" else getattr(self, name)(x)


def layer_collision(inner, x, outer):
    """Vertices `outer` against the garment `inner` at x."""
    with torch.no_grad():
        nearest = torch.cdist(outer, x, compute_mode=_mode).argmin(1)
    offset, normal = outer - x[nearest], normals(x, inner.faces)[nearest]
    gap = (offset * normal).sum(1)
    penalty = torch.relu(inner.settings["layer_epsilon"] - gap) ** 3
    if inner.settings["gate_depth"] is None:
        return penalty.sum()
    aside = (offset - gap[:, None] * normal).norm(dim=1)
    counted = (gap.abs() <= inner.settings["gate_depth"]) & (aside <= inner.settings["gate_edges"] * inner.median_edge)
    return penalty[counted].sum()


def layer_distance(body, x, outer, radius):
    """Order of the distances to the body of two garments at x and `outer`, over common nearest body vertices."""
    (inner_gap, inner_vertex), (outer_gap, outer_vertex) = body.gaps(x), body.gaps(outer)
    near = (inner_gap < radius)[:, None] & (outer_gap < radius)[None, :]
    same = (inner_vertex[:, None] == outer_vertex[None, :]) & near
    return (torch.relu(inner_gap[:, None] - outer_gap[None, :])[same] ** 3).sum()
