#!/usr/bin/env python3
"""The energies of this project beside the same terms in PyTorch: one Markdown table each for speed and growth.

Called by scripts/bench_energies.sh, which builds the program `energy_times` and exports its scenes. PyTorch is written as a
paper's authors would write it on a CPU: dense pairwise distances (torch.cdist), gathers over faces and hinges, gradients by
autograd, f32. Every value is compared with ours (relative 1e-4) before anything is timed, so that equal things are compared.
That check measures distances exactly; cdist's default, a matrix product, is what is timed because it is faster, although in
f32 it is off by up to 0.3 mm and now and then takes a neighbour for the nearest vertex (--exact-cdist times the exact form).
Both sides run with the same number of threads, in turn, several rounds; medians are printed.

    python3 scripts/bench_energies_torch.py --ours target/release/examples/energy_times --threads 2

PyTorch without a GPU: the Linux wheel of torch 2.15 does not import without its CUDA libraries, so that a plain
`pip install torch numpy` (with its dependencies) is needed even here. `--no-torch` prints our own tables only.
"""

import argparse
import math
import os
import statistics
import subprocess
import tempfile
import time

import numpy as np

TERMS = ["strain", "bending", "gravity", "body_collision", "repulsion", "holding"]
ALL = "all single-garment terms"
LAYER_TERMS = ["layer_collision", "layer_distance"]
TOLERANCE = 1e-4
EXACT = "donot_use_mm_for_euclid_dist"


class Scene:
    """One exported scene as tensors, with everything that positions do not change computed beforehand, as in ours."""

    THICKNESS, DENSITY, MU, LAMBDA = 4.7e-4, 426.0, 2.36e4, 4.44e4
    STIFFNESS, GRAVITY, RADIUS, EPSILON = 3.96e-5, 9.81, 0.1, 0.002

    def __init__(self, folder, size):
        read = lambda part: np.fromfile(f"{folder}/{size}_{part}.f32", "<f4").reshape(-1, 3)
        index = lambda part: np.fromfile(f"{folder}/{size}_{part}.u32", "<u4").reshape(-1, 3).astype(np.int64)
        rest = read("rest0").astype(np.float64)
        faces, body_faces = index("faces"), index("body_faces")
        tensor = torch.from_numpy
        narrow = lambda a: tensor(np.ascontiguousarray(a, np.float32))
        self.count = len(rest)
        self.x, self.outer, self.canonical = map(narrow, (read("posed0"), read("posed1"), read("canonical")))
        self.rest, self.body = narrow(rest), narrow(read("body"))
        self.faces = tensor(faces)
        self.body_normals = normals(self.body, tensor(body_faces))

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
        self.volume = narrow(area * self.THICKNESS)
        mass = np.zeros(self.count)
        np.add.at(mass, faces.ravel(), np.repeat(area * self.THICKNESS * self.DENSITY / 3, 3))
        self.weight = narrow(mass * self.GRAVITY)

        half = {}
        for face in faces:
            for k in range(3):
                half[(face[k], face[(k + 1) % 3])] = face[(k + 2) % 3]
        self.hinges = tensor(np.array([(p, q, o, half[q, p]) for (p, q), o in half.items() if p < q and (q, p) in half]))
        pairs = np.array(list(half))
        apart = torch.ones((self.count, self.count), dtype=torch.bool)
        apart[pairs[:, 0], pairs[:, 1]] = False
        apart[pairs[:, 1], pairs[:, 0]] = False
        apart.fill_diagonal_(False)
        self.apart = apart
        unique = np.unique(np.sort(pairs, axis=1), axis=0)
        lengths = np.sort(np.linalg.norm(rest[unique[:, 0]] - rest[unique[:, 1]], axis=1))
        self.median_edge = float(lengths[len(lengths) // 2])
        held = np.argsort(-rest[:, 1], kind="stable")[: math.ceil(0.1 * self.count - 1e-9)]
        self.held = tensor(held.copy())

    def strain(self, x):
        a, b, c = (x[self.faces[:, k]] for k in range(3))
        f = torch.stack([b - a, c - a], dim=2) @ self.inverse
        g = 0.5 * (f.transpose(1, 2) @ f - torch.eye(2))
        trace = g[:, 0, 0] + g[:, 1, 1]
        return (self.volume * (0.5 * self.LAMBDA * trace**2 + self.MU * (g * g).sum((1, 2)))).sum()

    def bending(self, x):
        a, b, c, d = (x[self.hinges[:, k]] for k in range(4))
        n1, n2 = torch.linalg.cross(b - a, c - a), torch.linalg.cross(d - a, b - a)
        edge = (b - a) / (b - a).norm(dim=1, keepdim=True)
        angle = torch.atan2((torch.linalg.cross(n1, n2) * edge).sum(1), (n1 * n2).sum(1))
        return 0.5 * self.STIFFNESS * (angle**2).sum()

    def gravity(self, x):
        return (self.weight * x[:, 1]).sum()

    def gaps(self, x):
        with torch.no_grad():
            nearest = torch.cdist(x, self.body, compute_mode=MODE).argmin(1)
        return ((x - self.body[nearest]) * self.body_normals[nearest]).sum(1), nearest

    def body_collision(self, x):
        return (torch.relu(self.EPSILON - self.gaps(x)[0]) ** 3).sum()

    def repulsion(self, x):
        distance = torch.cdist(x, x, compute_mode=MODE)
        close = (distance < self.RADIUS) & self.apart
        return -torch.log(torch.where(close, distance, torch.ones(())) ** 2).sum() / (2 * self.count)

    def holding(self, y):
        return ((y[self.held, 1] - self.rest[self.held, 1]) ** 2).sum()

    def layer_collision(self, x, outer):
        with torch.no_grad():
            nearest = torch.cdist(outer, x, compute_mode=MODE).argmin(1)
        offset, normal = outer - x[nearest], normals(x, self.faces)[nearest]
        gap = (offset * normal).sum(1)
        aside = (offset - gap[:, None] * normal).norm(dim=1)
        counted = (gap.abs() <= 0.05) & (aside <= 0.75 * self.median_edge)
        return (torch.relu(self.EPSILON - gap)[counted] ** 3).sum()

    def layer_distance(self, x, outer):
        (inner_gap, inner_vertex), (outer_gap, outer_vertex) = self.gaps(x), self.gaps(outer)
        near = (inner_gap < self.RADIUS)[:, None] & (outer_gap < self.RADIUS)[None, :]
        same = (inner_vertex[:, None] == outer_vertex[None, :]) & near
        return (torch.relu(inner_gap[:, None] - outer_gap[None, :])[same] ** 3).sum()

    def run(self, term, gradient):
        """Value of a term; with `gradient`, after its backward pass."""
        x, y, outer = (t.detach().clone().requires_grad_(gradient) for t in (self.x, self.canonical, self.outer))
        with torch.set_grad_enabled(gradient):
            if term == ALL:
                value = sum(getattr(self, t)(y if t == "holding" else x) for t in TERMS)
            elif term in LAYER_TERMS:
                value = getattr(self, term)(x, outer)
            else:
                value = getattr(self, term)(y if term == "holding" else x)
            if gradient:
                value.backward()
        return value.detach().item()


def normals(x, faces):
    a, b, c = (x[faces[:, k]] for k in range(3))
    summed = torch.zeros_like(x).index_add(0, faces.T.ravel(), torch.linalg.cross(b - a, c - a).repeat(3, 1))
    return summed / summed.norm(dim=1, keepdim=True).clamp_min(1e-20)


def median_ms(run, seconds):
    run()
    times, start = [], time.perf_counter()
    while len(times) < 3 or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - before))
    return statistics.median(times)


def ours(options, sizes, *extra, threads=None):
    """{(term, asked size): (vertices, value ms, gradient ms, total)}"""
    environment = dict(os.environ, RAYON_NUM_THREADS=str(threads or options.threads))
    found = {}
    for size in sizes:
        command = [options.ours, "--sizes", str(size), "--seconds", str(options.seconds), *extra]
        output = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
        for line in output.splitlines()[1:]:
            term, vertices, value, gradient, total = line.split("\t")
            found[term, size] = (int(vertices), float(value), float(gradient), float(total))
    return found


def middle(rounds, column):
    return {key: statistics.median(r[key][column] for r in rounds) for key in rounds[0]}


def milliseconds(x):
    return f"{x:.3f}" if x < 1 else f"{x:.2f}" if x < 100 else f"{x:.0f}"


def exponent(times, sizes):
    """Slope of log time over log size, least squares."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


def compare(options, folder):
    """Our times and PyTorch's in turn."""
    global MODE
    timed_mode, MODE = MODE, EXACT
    sizes = options.torch_sizes
    scenes = {size: Scene(folder, size) for size in sizes}
    for size, scene in scenes.items():
        exact = ours(options, [size])
        wrong = []
        for term in TERMS + [ALL] + LAYER_TERMS:
            expected, found = exact[term, size][3], scene.run(term, False)
            if abs(found - expected) > TOLERANCE * abs(expected):
                wrong.append(f"{term} at {size}: PyTorch has {found:.8g}, ours is {expected:.8g}")
        if wrong:
            raise SystemExit("\n".join(wrong))
    MODE = timed_mode
    mine, theirs = [], []
    for _ in range(options.rounds):
        mine.append(ours(options, sizes))
        theirs.append({
            (term, size): [median_ms(lambda: scene.run(term, g), options.seconds) for g in (False, True)]
            for size, scene in scenes.items() for term in TERMS + [ALL] + LAYER_TERMS
        })
    for size in sizes:
        print(f"\n### {size:,} vertices, {options.threads} threads [ms]\n")
        print("| term | ours, value | ours, value + gradient | PyTorch, value | PyTorch, value + gradient | ratio |")
        print("|---|---:|---:|---:|---:|---:|")
        v, g = middle(mine, 1), middle(mine, 2)
        tv, tg = middle(theirs, 0), middle(theirs, 1)
        for term in TERMS + [ALL] + LAYER_TERMS:
            k = (term, size)
            cells = " | ".join(map(milliseconds, (v[k], g[k], tv[k], tg[k])))
            print(f"| {term} | {cells} | {tg[k] / g[k]:.0f}× |")
    print(f"\nValues of all terms agree with ours within {TOLERANCE:g} (relative) at every size.")


def growth(options):
    """Our times over all sizes."""
    sizes = options.sizes
    cases = [
        ("1 m² resolved more finely, repulsion over 16 partners (training)", ["--growth", "area", "--subset", "16"]),
        ("1 m² resolved more finely, repulsion over all pairs", ["--growth", "area"]),
        ("edges of 12 mm, larger garment, repulsion over all pairs", ["--growth", "edge"]),
    ]
    rounds = {name: [] for name, _ in cases}
    for _ in range(options.rounds):
        for name, extra in cases:
            rounds[name].append(ours(options, sizes, *extra))
    for name, _ in cases:
        times = middle(rounds[name], 2)
        print(f"\n### {name}, value + gradient, {options.threads} threads [ms]\n")
        header = " | ".join(f"{size:,}" for size in sizes)
        print(f"| term | {header} | exponent from 5,000 | per vertex, 50,000 : 5,000 |")
        print("|---|" + "---:|" * (len(sizes) + 2))
        for term in TERMS + [ALL] + LAYER_TERMS:
            row = [times[term, size] for size in sizes]
            large = [s for s in sizes if s >= 5000]
            slope = f"{exponent([times[term, s] for s in large], large):.2f}" if len(large) > 1 else "–"
            ratio = f"{times[term, 50000] / times[term, 5000] / 10:.2f}" if {5000, 50000} <= set(sizes) else "–"
            print(f"| {term} | {' | '.join(map(milliseconds, row))} | {slope} | {ratio} |")


def main():
    numbers = lambda text: [int(n) for n in text.split(",")]
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--ours", default="target/release/examples/energy_times", help="the built example")
    parser.add_argument("--sizes", type=numbers, default=numbers("1000,2000,5000,8000,20000,50000"))
    parser.add_argument("--torch-sizes", type=numbers, default=numbers("2000,8000"))
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=0.3, help="per measurement")
    parser.add_argument("--no-torch", action="store_true")
    parser.add_argument("--no-growth", action="store_true")
    parser.add_argument("--exact-cdist", action="store_true", help="cdist without its matrix product: slower, more exact")
    options = parser.parse_args()
    if not options.no_torch:
        global torch, MODE
        import torch

        MODE = EXACT if options.exact_cdist else "use_mm_for_euclid_dist_if_necessary"
        torch.set_num_threads(options.threads)
        print(f"PyTorch {torch.__version__}")
        with tempfile.TemporaryDirectory() as folder:
            sizes = ",".join(map(str, options.torch_sizes))
            subprocess.run([options.ours, "--sizes", sizes, "--export", folder], check=True)
            compare(options, folder)
    if not options.no_growth:
        growth(options)


if __name__ == "__main__":
    main()
