#!/usr/bin/env python3
"""Training and draping beside the same networks and losses in PyTorch, on the same cores or GPU: Markdown tables and JSON.

Called by scripts/bench_vs_torch.sh and gpu_check.sh. For every case `clothcombo bench step` writes out a scene and its
networks; PyTorch (torch_networks.py, torch_losses.py) loads both, and its positions, loss and gradient norm of every network
must agree with ours before anything is timed. Then both sides run in turn with the same number of threads; medians over all
rounds are printed. A run with switches that are not implemented is refused, and they are named.

    python3 scripts/bench_torch.py --ours target/release/clothcombo --widths 128 --layers 1,3
    python3 scripts/bench_torch.py --config configs/paper.toml --stage 1 --set model.width=64 --check
    python3 scripts/bench_torch.py --torch-device cuda --tf32 --device wgpu --widths 512 --vertices 8000 --json cases.jsonl

The scene is always written by flex, the processor, so that the check needs no GPU of ours. It is compared in f32 (TF32
off); `--tf32` times both. Nothing is chunked on any device: counted by hand, the dense distances of six garments of 8,000 vertices
take about 10 GB.

forward             all networks without gradients, the garments' embedding included
forward + backward  the same with autodiff, from a fixed gradient at the positions
step                networks, losses, backward pass, clip of the global norm to 1, Adam
step on two outfits  the same with the gradients of two outfits accumulated before clip and Adam
losses              all losses and their gradient at fixed positions
drape again         all networks but the embedding, which is kept
memory              largest resident memory of a process that trains (VmHWM after the first step's set-up); of PyTorch on a GPU
                    the most that its tensors take there
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

from exported_scene import GARMENT_TERMS, ExportedScene

try:
    import torch

    import torch_losses as losses
    from torch_networks import ClothCombo

    torch.sparse.check_sparse_tensor_invariants.disable()  # said explicitly, which silences a warning
except ImportError as error:
    torch, missing = None, error

# Networks by the names of ours, and what their parameters are called in torch_networks.py.
NETWORKS = {
    "garment_encoder": ["encoder"], "draping": ["embedding", "displacement"], "skinning": ["skinning"],
    "untangling": ["force", "untangling"],
}
PARTS = {
    "forward": "forward_ms",
    "forward + backward": "forward_backward_ms",
    "step": "step_ms",
    "step on two outfits": "step_of_several_ms",
    "losses": "losses_ms",
    "drape again": "drape_ms",
}
SIDES = {"ours_ms": "ours", "torch_ms": "PyTorch", "torch_tf32_ms": "PyTorch with TF32"}


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
            matrix = torch.sparse_coo_tensor(losses.indices(places), values, (count, count)).coalesce()
            setattr(self, f"gradient_{axis}", matrix)


class Outfit:
    """Everything of one exported scene that the networks see."""

    def __init__(self, arrays, about):
        count = len(about["garments"])
        self.garments = [GarmentTensors(arrays, f"garment{i}") for i in range(count)]
        self.rest = torch.cat([g.rest for g in self.garments])
        self.weights = torch.cat([g.weights for g in self.garments])
        self.mask = torch.stack([(g.weights != 0).any(0).float() for g in self.garments])
        if about["model"]["skinning_joints"] == "all":
            self.mask = torch.ones_like(self.mask)
        self.of_vertex = losses.indices(np.repeat(np.arange(count), [len(g.rest) for g in self.garments]))
        self.start, self.shape, self.pose = (losses.narrow(arrays[k]) for k in ("start", "shape", "pose"))
        self.bones = losses.narrow(arrays["bones"]).reshape(-1, 3, 4)
        self.contacts = about["contacts"]
        both = [(a, b) for a, b in self.contacts] + [(b, a) for a, b in self.contacts]
        self.edges = losses.indices(np.array(both, np.int64).reshape(-1, 2).T)
        i, j = self.edges
        self.from_below, self.from_above = (j < i).nonzero()[:, 0], (j > i).nonzero()[:, 0]
        self.touched = torch.zeros((count, 1), device=self.rest.device)
        self.touched[slice(None) if about["model"]["graph"] == "full" else i] = 1
        # On the host, so that no step waits for a GPU to say it.
        self.moves = bool(self.touched.any())


class Scene:
    """Networks, losses and optimiser of one exported case."""

    def __init__(self, folder):
        read = ExportedScene(folder)
        self.about, self.arrays = read.about, read.arrays
        arrays = self.arrays
        self.outfit = Outfit(arrays, self.about)
        parameters = {name: torch.from_numpy(array) for name, array in read.parameters.items()}
        self.parameters = sum(p.numel() for p in parameters.values())
        self.model = ClothCombo(parameters, self.about["model"]).to(self.outfit.rest.device)
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
        for i, garment in enumerate(self.garments):
            if self.about["garments"][i]["held_posed"]:
                garment.pull_back(part(i, "skin_weights"), arrays["bones"].reshape(-1, 3, 4))
        self.sizes = [garment.count for garment in self.garments]
        count = sum(self.sizes)
        self.pull = losses.narrow(np.arange(3 * count) * 37 % 101 / 50 - 1).reshape(count, 3)

    def loss(self, posed, canonical, layers=True):
        x, y = posed.split(self.sizes), canonical.split(self.sizes)
        total = posed.new_zeros(())
        for i, garment in enumerate(self.garments):
            about = self.about["garments"][i]
            for term, weight in about["weights"].items():
                if term in GARMENT_TERMS and (term != "holding" or about["held"]):
                    total = total + weight * garment.term(term, x[i], y[i], self.body)
        for pair in self.about["layers"] if layers else []:
            inner, outer, weights = pair["inner"], pair["outer"], pair["weights"]
            if "layer_collision" in weights:
                total = total + weights["layer_collision"] * losses.layer_collision(self.garments[inner], x[inner], x[outer])
            if "layer_distance" in weights:
                radius = self.about["settings"]["layer_radius"]
                total = total + weights["layer_distance"] * losses.layer_distance(self.body, x[inner], x[outer], radius)
        return total

    def objective(self):
        """What a step minimises."""
        single_weight = self.about["single_garments"]
        if not single_weight:
            return self.loss(*self.model(self.outfit))
        posed, canonical, *single = self.model(self.outfit, with_single=True)
        return self.loss(posed, canonical) + single_weight * self.loss(*single, layers=False)

    def forward(self):
        with torch.no_grad():
            return self.model(self.outfit)

    def forward_backward(self):
        self.optimizer.zero_grad()
        posed, _ = self.model(self.outfit)
        (posed * self.pull).sum().backward()

    def gradients(self):
        self.optimizer.zero_grad()
        loss = self.objective()
        loss.backward()
        return loss.item()

    def step(self, scenes=1):
        self.optimizer.zero_grad()
        for _ in range(scenes):
            loss = self.objective() / scenes
            loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), self.clip_norm)
        self.optimizer.step()
        return loss.item(), norm.item()

    def losses_only(self):
        posed, canonical = (x.detach().clone().requires_grad_() for x in self.positions)
        self.loss(posed, canonical).backward()

    def check(self):
        """Stops unless positions, loss and the gradient norm of every network are ours."""
        losses.set_exact(True)
        self.positions = posed, canonical = self.forward()
        expected = self.about["expected"]
        wrong = []
        for name, found in [("posed", posed), ("canonical", canonical)]:
            difference = float(np.abs(found.cpu().numpy() - self.arrays[f"expected.{name}"]).max())
            if not difference < 1e-5:
                wrong.append(f"{name} positions differ by {difference:.2g} m")
        compared = [("loss", self.gradients(), expected["loss"])]
        compared += [(f"gradient of {name}", self.norm(NETWORKS[name]), norm) for name, norm in expected["gradient_norms"].items()]
        for name, found, ours in compared:
            if not abs(found - ours) <= 1e-3 * abs(ours):
                wrong.append(f"{name}: PyTorch has {found:.8g}, ours is {ours:.8g}")
        losses.set_exact(False)
        if wrong:
            raise SystemExit("\n".join(wrong))
        return {name: abs(found / ours - 1) for name, found, ours in compared if ours}

    def norm(self, modules):
        """Gradient norm of some modules."""
        parameters = [p for module in modules for p in getattr(self.model, module).parameters() if p.grad is not None]
        return sum(float(p.grad.double().square().sum()) for p in parameters) ** 0.5

    def times(self, seconds):
        found = {name: median_ms(run, seconds) for name, run in [
            ("forward", self.forward), ("forward + backward", self.forward_backward), ("step", self.step),
            ("step on two outfits", lambda: self.step(2)), ("losses", self.losses_only)]}
        with torch.no_grad():
            embeddings = self.model.encode(self.outfit)
            found["drape again"] = median_ms(lambda: self.model(self.outfit, embeddings), seconds)
        return found


def median_ms(run, seconds):
    run()
    settle()
    times, start = [], time.perf_counter()
    while len(times) < 3 or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        run()
        settle()
        times.append(1e3 * (time.perf_counter() - before))
    return statistics.median(times)


def settle():
    """Waits for a GPU."""
    if torch.cuda.is_initialized():
        torch.cuda.synchronize()


def set_tf32(on):
    torch.set_float32_matmul_precision("high" if on else "highest")


def peak_device_mib(scene):
    """Largest allocated memory of the GPU while `scene` trains three steps, and what the allocator holds for it."""
    scene.optimizer.zero_grad()
    torch.cuda.empty_cache()
    torch.cuda.reset_peak_memory_stats()
    for _ in range(3):
        scene.step()
    return torch.cuda.max_memory_allocated() / 2**20, torch.cuda.max_memory_reserved() / 2**20


def peak_mib(folder):
    """Largest resident memory of this process while it trains three steps."""
    scene = Scene(folder)
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    for _ in range(3):
        scene.step()
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmHWM:"))


def ours(options, case, folder=None):
    """Our times, or with `folder` only the files of the case."""
    command = [options.ours, "bench", "step", "--json", "--steps", "3", "--seconds", str(options.seconds)]
    device = "flex" if folder else options.device
    if device:
        command += ["--device", device]
    # Clipped once a step, as PyTorch's users do.
    command += ["--accumulate", "2", "--set", "optimizer.clip=step", *case]
    for setting in options.set:
        command += ["--set", setting]
    if folder:
        command += ["--export", folder, "--export-only"]
    environment = dict(os.environ, RAYON_NUM_THREADS=str(options.threads))
    output = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True).stdout
    return None if folder else json.loads(output)["cases"][0]


def compare(options, case):
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        ours(options, case, folder)
        exported = time.perf_counter()
        if options.read:
            return print(ExportedScene(folder).check())
        scene = Scene(folder)
        settle()
        prepared = time.perf_counter()
        set_tf32(False)
        about = {
            "width": scene.about["model"]["width"], "layers": len(scene.about["garments"]), "vertices": sum(scene.sizes),
            "parameters": scene.parameters, "torch_device": options.torch_device, "agreement": scene.check(),
            "export_s": exported - start, "prepare_s": prepared - exported,
        }
        print(f"width {about['width']}, M = {about['layers']}: agreement {about['agreement']}", file=sys.stderr)
        if options.check:
            return about
        mine, theirs, tf32 = [], [], []
        for _ in range(options.rounds):
            if not options.no_ours_timing:
                mine.append(ours(options, case))
            theirs.append(scene.times(options.seconds))
            if options.tf32:
                set_tf32(True)
                tf32.append(scene.times(options.seconds))
                set_tf32(False)
        peak = {}
        if options.torch_device == "cuda":
            peak["torch"], peak["torch_reserved"] = peak_device_mib(scene)
        else:
            command = [sys.executable, __file__, "--peak-of", folder, "--threads", str(options.threads)]
            peak["torch"] = float(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
            if mine:
                peak["ours"] = statistics.median(m["costs"]["peak_mib"] for m in mine)
    parts = {}
    for name, key in PARTS.items():
        sides = {"ours_ms": [m["costs"][key] for m in mine]}
        sides |= {"torch_ms": [t[name] for t in theirs], "torch_tf32_ms": [t[name] for t in tf32]}
        parts[name] = {side: statistics.median(times) for side, times in sides.items() if times}
    return {**about, "rounds": options.rounds, "parts": parts, "peak_mib": peak}


def milliseconds(x):
    return f"{x:.2f}" if x < 10 else f"{x:.1f}" if x < 100 else f"{x:.0f}"


def print_tables(cases):
    names = list(PARTS)
    print("| width | M | vertices | " + " | ".join(names) + " | peak memory [MiB] |")
    print("|---:|---:|---:|" + "---:|" * (len(names) + 1))
    for case in cases:
        cells = []
        for name in names:
            part = case["parts"][name]
            cells.append(" / ".join(milliseconds(part[side]) for side in SIDES if side in part))
            if "ours_ms" in part:
                cells[-1] += f" = **{part['torch_ms'] / part['ours_ms']:.1f}×**"
        peak = case["peak_mib"]
        cells.append(" / ".join(f"{peak[side]:.0f}" for side in ("ours", "torch") if side in peak))
        print(f"| {case['width']} | {case['layers']} | {case['vertices']} | " + " | ".join(cells) + " |")


def main():
    numbers = lambda text: [int(n) for n in text.split(",")]
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--ours", default="target/release/clothcombo", help="the built program")
    parser.add_argument("--widths", type=numbers, default=numbers("64,128,512"))
    parser.add_argument("--layers", type=numbers, default=numbers("1,3,6"))
    parser.add_argument("--vertices", type=int, default=2000, help="per garment, about")
    parser.add_argument("--config", help="a stage of this configuration instead of made-up cases")
    parser.add_argument("--stage", default="0", help="with --config: which one, from 0")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="overrides one value; repeatable")
    parser.add_argument("--check", action="store_true", help="only compare positions, loss and gradients")
    parser.add_argument("--read", action="store_true", help="only read what is exported, which needs no torch")
    parser.add_argument("--torch-device", choices=["cpu", "cuda"], default="cpu", help="where PyTorch computes")
    parser.add_argument("--tf32", action="store_true", help="also time PyTorch with TF32 matrix products, on a GPU")
    parser.add_argument("--device", help="where we compute, as of clothcombo bench step --device")
    parser.add_argument("--no-ours-timing", action="store_true", help="time PyTorch only; the check stays")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=1.0, help="per measurement and round")
    parser.add_argument("--json", help="file that collects the cases of several runs, one a line")
    parser.add_argument("--peak-of", help=argparse.SUPPRESS)
    options = parser.parse_args()
    made_up = [
        ["--widths", str(width), "--layers", str(layers), "--vertices", str(options.vertices)]
        for width in options.widths for layers in options.layers
    ]
    wanted = [["--config", options.config, "--stage", options.stage]] if options.config else made_up
    if options.read:
        for case in wanted:
            compare(options, case)
        return
    if torch is None:
        sys.exit(f"{missing}; --read needs numpy alone")
    torch.set_num_threads(options.threads)
    losses.set_device(options.torch_device)
    if options.peak_of:
        return print(peak_mib(options.peak_of))
    cases = []
    for case in wanted:
        cases.append(compare(options, case))
        if options.json:
            with open(options.json, "a") as file:
                file.write(json.dumps(cases[-1]) + "\n")
    if options.check:
        return
    sides = [label for side, label in SIDES.items() if side in cases[0]["parts"]["step"]]
    where = torch.cuda.get_device_name() if options.torch_device == "cuda" else f"{options.threads} threads"
    print(f"PyTorch {torch.__version__}, {where}, {' / '.join(sides)} [ms]\n")
    print_tables(cases)


if __name__ == "__main__":
    main()
