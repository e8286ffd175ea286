#!/usr/bin/env python3
"""The energies of this project beside the same terms in PyTorch: one Markdown table each for speed and growth.

Called by scripts/bench_energies.sh, which builds the program `energy_times` and exports its scenes. The PyTorch side is
torch_losses.py. Every value is compared with ours (relative 1e-4) before anything is timed, so that equal things are compared.
That check measures distances exactly; cdist's default, a matrix product, is what is timed because it is faster, although in
f32 it is off by up to 0.3 mm and now and then takes a neighbour for the nearest vertex (--exact-cdist times the exact form).
Both sides run with the same number of threads, in turn, several rounds; medians are printed.

    python3 scripts/bench_energies_torch.py --ours target/release/examples/energy_times --threads 2

PyTorch without a GPU: the Linux wheel of torch 2.15 does not import without its CUDA libraries, so that a plain
`pip install torch numpy` (with its dependencies) is needed even here. `--no-torch` prints our own tables only.
"""

import argparse
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


class Scene:
    """One exported scene: two garments and a body."""

    def __init__(self, folder, size):
        read = lambda part: np.fromfile(f"{folder}/{size}_{part}.f32", "<f4").reshape(-1, 3)
        index = lambda part: np.fromfile(f"{folder}/{size}_{part}.u32", "<u4").reshape(-1, 3)
        rest = read("rest0").astype(np.float64)
        self.x, self.outer, self.canonical = map(losses.narrow, (read("posed0"), read("posed1"), read("canonical")))
        self.body = losses.Body(read("body"), index("body_faces"))
        self.garment = losses.Garment(rest, index("faces"), rest)

    def run(self, term, gradient):
        """Value of a term; with `gradient`, after its backward pass."""
        x, y, outer = (t.detach().clone().requires_grad_(gradient) for t in (self.x, self.canonical, self.outer))
        with torch.set_grad_enabled(gradient):
            if term == ALL:
                value = sum(self.garment.term(t, x, y, self.body) for t in TERMS)
            elif term == "layer_collision":
                value = losses.layer_collision(self.garment, x, outer)
            elif term == "layer_distance":
                value = losses.layer_distance(self.body, x, outer, self.garment.settings["layer_radius"])
            else:
                value = self.garment.term(term, x, y, self.body)
            if gradient:
                value.backward()
        return value.detach().item()


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
    losses.set_exact(True)
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
    losses.set_exact(options.exact_cdist)
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
    parser.add_argument("--exact-cdist", action="store_true", help="time the forms that are compared: slower, more exact")
    options = parser.parse_args()
    if not options.no_torch:
        global torch, losses
        import torch
        import torch_losses as losses

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
