#!/usr/bin/env python3
"""Training and draping beside the same networks and losses in PyTorch, on the same cores: Markdown tables and JSON.

Called by scripts/bench_vs_torch.sh. For every case `clothcombo bench step` writes out a scene and its networks; PyTorch
(torch_networks.py, torch_losses.py) loads both, and its positions, loss and gradient norm must agree with ours before
anything is timed. Then both sides run in turn with the same number of threads; medians over all rounds are printed.

    python3 scripts/bench_torch.py --ours target/release/clothcombo --widths 128 --layers 1,3

forward             all networks without gradients, the garments' embedding included
forward + backward  the same with autodiff, from a fixed gradient at the positions
step                networks, losses, backward pass, clip of the global norm to 1, Adam
step on two outfits  the same with the gradients of two outfits accumulated before clip and Adam
losses              all losses and their gradient at fixed positions
drape again         all networks but the embedding, which is kept
memory              largest resident memory of a process that trains (VmHWM after the first step's set-up)
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
import torch

import torch_losses as losses
from torch_networks import ClothCombo, read_safetensors

torch.sparse.check_sparse_tensor_invariants.disable()  # said explicitly, which silences a warning
PARTS = {
    "forward": "forward_ms",
    "forward + backward": "forward_backward_ms",
    "step": "step_ms",
    "step on two outfits": "step_of_several_ms",
    "losses": "losses_ms",
    "drape again": "drape_ms",
}


class GarmentTensors:
    def __init__(self, arrays, prefix):
        read = lambda name: arrays[f"{prefix}.{name}"]
        self.rest = losses.narrow(read("rest"))
        self.mass, self.eigenvalues = losses.narrow(read("mass")), losses.narrow(read("eigenvalues"))
        self.eigenvectors = losses.narrow(read("eigenvectors"))
        self.weights = losses.narrow(read("skin_weights"))
        count = len(self.rest)
        for axis in "xy":
            places = np.stack([read(f"gradient_{axis}.rows"), read(f"gradient_{axis}.columns")]).astype(np.int64)
            values = losses.narrow(read(f"gradient_{axis}.values"))
            matrix = torch.sparse_coo_tensor(torch.from_numpy(places), values, (count, count)).coalesce()
            setattr(self, f"gradient_{axis}", matrix)


class Outfit:
    """Everything of one exported scene that the networks see."""

    def __init__(self, arrays, about):
        count = len(about["garments"])
        self.garments = [GarmentTensors(arrays, f"garment{i}") for i in range(count)]
        self.rest = torch.cat([g.rest for g in self.garments])
        self.weights = torch.cat([g.weights for g in self.garments])
        self.mask = torch.stack([(g.weights != 0).any(0).float() for g in self.garments])
        self.of_vertex = torch.repeat_interleave(torch.arange(count), torch.tensor([len(g.rest) for g in self.garments]))
        self.start, self.shape, self.pose = (losses.narrow(arrays[k]) for k in ("start", "shape", "pose"))
        self.bones = losses.narrow(arrays["bones"]).reshape(-1, 3, 4)
        self.contacts = about["contacts"]
        both = [(a, b) for a, b in self.contacts] + [(b, a) for a, b in self.contacts]
        self.edges = torch.tensor(both, dtype=torch.long).reshape(-1, 2).T
        self.touched = torch.zeros((count, 1))
        self.touched[self.edges[0]] = 1


class Scene:
    """Networks, losses and optimiser of one exported case."""

    def __init__(self, folder):
        with open(f"{folder}/scene.json") as file:
            self.about = json.load(file)
        arrays = self.arrays = np.load(f"{folder}/scene.npz")
        self.outfit = Outfit(arrays, self.about)
        self.model = ClothCombo(read_safetensors(f"{folder}/model.safetensors"), self.about["model"])
        optimizer = self.about["optimizer"]
        self.clip_norm = optimizer["clip_norm"]
        self.optimizer = torch.optim.Adam(
            self.model.parameters(), 1e-4, betas=(optimizer["beta_1"], optimizer["beta_2"]), eps=optimizer["epsilon"]
        )
        self.body = losses.Body(arrays["body.positions"], arrays["body.faces"])
        part = lambda i, name: arrays[f"garment{i}.{name}"]
        self.garments = [
            losses.Garment(part(i, "rest"), part(i, "faces"), part(i, "holding_reference"), self.about["settings"])
            for i in range(len(self.outfit.garments))
        ]
        self.sizes = [garment.count for garment in self.garments]
        count = sum(self.sizes)
        self.pull = ((torch.arange(3 * count) * 37 % 101) / 50 - 1).reshape(count, 3)

    def loss(self, posed, canonical):
        x, y = posed.split(self.sizes), canonical.split(self.sizes)
        total = posed.new_zeros(())
        for i, garment in enumerate(self.garments):
            about = self.about["garments"][i]
            for term, weight in about["weights"].items():
                if term in losses.GARMENT_TERMS and (term != "holding" or about["held"]):
                    total = total + weight * garment.term(term, x[i], y[i], self.body)
        for pair in self.about["layers"]:
            inner, outer, weights = pair["inner"], pair["outer"], pair["weights"]
            if "layer_collision" in weights:
                total = total + weights["layer_collision"] * losses.layer_collision(self.garments[inner], x[inner], x[outer])
            if "layer_distance" in weights:
                radius = self.about["settings"]["layer_radius"]
                total = total + weights["layer_distance"] * losses.layer_distance(self.body, x[inner], x[outer], radius)
        return total

    def forward(self):
        with torch.no_grad():
            return self.model(self.outfit)

    def forward_backward(self):
        self.optimizer.zero_grad()
        posed, _ = self.model(self.outfit)
        (posed * self.pull).sum().backward()

    def gradients(self):
        self.optimizer.zero_grad()
        loss = self.loss(*self.model(self.outfit))
        loss.backward()
        return loss.item()

    def step(self, scenes=1):
        self.optimizer.zero_grad()
        for _ in range(scenes):
            loss = self.loss(*self.model(self.outfit)) / scenes
            loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), self.clip_norm)
        self.optimizer.step()
        return loss.item(), norm.item()

    def losses_alone(self):
        posed, canonical = (x.detach().clone().requires_grad_() for x in self.positions)
        self.loss(posed, canonical).backward()

    def check(self):
        """Stops unless positions, loss and gradient norm are ours."""
        losses.set_exact(True)
        self.positions = posed, canonical = self.forward()
        expected = self.about["expected"]
        wrong = []
        for name, found in [("posed", posed), ("canonical", canonical)]:
            difference = float(np.abs(found.numpy() - self.arrays[f"expected.{name}"]).max())
            if not difference < 1e-5:
                wrong.append(f"{name} positions differ by {difference:.2g} m")
        loss = self.gradients()
        norm = sum(float(p.grad.double().square().sum()) for p in self.model.parameters() if p.grad is not None) ** 0.5
        for name, found in [("loss", loss), ("gradient_norm", norm)]:
            if not abs(found - expected[name]) <= 1e-3 * abs(expected[name]):
                wrong.append(f"{name}: PyTorch has {found:.8g}, ours is {expected[name]:.8g}")
        losses.set_exact(False)
        if wrong:
            raise SystemExit("\n".join(wrong))
        return {"loss": abs(loss / expected["loss"] - 1), "gradient norm": abs(norm / expected["gradient_norm"] - 1)}

    def times(self, seconds):
        found = {name: median_ms(run, seconds) for name, run in [
            ("forward", self.forward), ("forward + backward", self.forward_backward), ("step", self.step),
            ("step on two outfits", lambda: self.step(2)), ("losses", self.losses_alone)]}
        with torch.no_grad():
            embeddings = self.model.encode(self.outfit)
            found["drape again"] = median_ms(lambda: self.model(self.outfit, embeddings), seconds)
        return found


def median_ms(run, seconds):
    run()
    times, start = [], time.perf_counter()
    while len(times) < 3 or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - before))
    return statistics.median(times)


def peak_mib(folder):
    """Largest resident memory of this process while it trains three steps."""
    scene = Scene(folder)
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    for _ in range(3):
        scene.step()
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmHWM:"))


def ours(options, width, layers, folder=None):
    command = [options.ours, "bench", "step", "--json", "--steps", "3", "--seconds", str(options.seconds)]
    command += ["--accumulate", "2", "--widths", str(width), "--layers", str(layers), "--vertices", str(options.vertices)]
    if folder:
        command += ["--export", folder]
    environment = dict(os.environ, RAYON_NUM_THREADS=str(options.threads))
    output = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
    return json.loads(output)["cases"][0]


def compare(options, width, layers):
    with tempfile.TemporaryDirectory() as folder:
        mine = [ours(options, width, layers, folder)]
        scene = Scene(folder)
        agreement = scene.check()
        theirs = [scene.times(options.seconds)]
        for _ in range(1, options.rounds):
            mine.append(ours(options, width, layers))
            theirs.append(scene.times(options.seconds))
        command = [sys.executable, __file__, "--peak-of", folder, "--threads", str(options.threads)]
        peak = float(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
    middle = lambda values: statistics.median(values)
    parts = {
        name: {"ours_ms": middle([m["costs"][key] for m in mine]), "torch_ms": middle([t[name] for t in theirs])}
        for name, key in PARTS.items()
    }
    return {
        "width": width, "layers": layers, "vertices": mine[0]["vertices"], "parameters": mine[0]["parameters"],
        "rounds": options.rounds, "agreement": agreement, "parts": parts,
        "peak_mib": {"ours": middle([m["costs"]["peak_mib"] for m in mine]), "torch": peak},
    }


def milliseconds(x):
    return f"{x:.2f}" if x < 10 else f"{x:.1f}" if x < 100 else f"{x:.0f}"


def print_tables(cases):
    names = list(PARTS)
    print("| width | M | vertices | " + " | ".join(names) + " | peak memory [MiB] |")
    print("|---:|---:|---:|" + "---:|" * (len(names) + 1))
    for case in cases:
        cells = []
        for name in names:
            mine, theirs = case["parts"][name]["ours_ms"], case["parts"][name]["torch_ms"]
            cells.append(f"{milliseconds(mine)} / {milliseconds(theirs)} = **{theirs / mine:.1f}×**")
        peak = case["peak_mib"]
        cells.append(f"{peak['ours']:.0f} / {peak['torch']:.0f}")
        print(f"| {case['width']} | {case['layers']} | {case['vertices']} | " + " | ".join(cells) + " |")


def main():
    numbers = lambda text: [int(n) for n in text.split(",")]
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--ours", default="target/release/clothcombo", help="the built program")
    parser.add_argument("--widths", type=numbers, default=numbers("64,128,512"))
    parser.add_argument("--layers", type=numbers, default=numbers("1,3,6"))
    parser.add_argument("--vertices", type=int, default=2000, help="per garment, about")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=1.0, help="per measurement and round")
    parser.add_argument("--json", help="file that collects the cases of several runs, one a line")
    parser.add_argument("--peak-of", help=argparse.SUPPRESS)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    if options.peak_of:
        return print(peak_mib(options.peak_of))
    cases = []
    for width in options.widths:
        for layers in options.layers:
            cases.append(compare(options, width, layers))
            print(f"width {width}, M = {layers}: agreement {cases[-1]['agreement']}", file=sys.stderr)
            if options.json:
                with open(options.json, "a") as file:
                    file.write(json.dumps(cases[-1]) + "\n")
    print(f"PyTorch {torch.__version__}, {options.threads} threads, ours / PyTorch [ms]\n")
    print_tables(cases)


if __name__ == "__main__":
    main()
