#!/usr/bin/env python3
"""The four networks as an ordinary `torch.nn.Module`, with the parameters of a model.safetensors: draped beside the program, then
one training step on the physical losses of clothcombo.torch.

    clothcombo bench step --widths 16 --layers 2 --vertices 200 --export scene --export-only
    python3 python/examples/networks.py scene

The module is scripts/torch_networks.py; `--config` instead of sizes exports a scene of your own configuration. Without the
correction networks, which are no part of the paper.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

import torch
from bench_torch import Outfit
from exported_scene import ExportedScene
from torch_networks import ClothCombo

import clothcombo
from clothcombo.torch import PhysicsLoss


def main(folder):
    exported = ExportedScene(folder)
    about, arrays = exported.about, exported.arrays
    networks = ClothCombo({name: torch.from_numpy(x) for name, x in exported.parameters.items()}, about["model"])
    outfit = Outfit(arrays, about)

    with torch.no_grad():
        posed, canonical = networks(outfit)[:2]
    difference = (posed - torch.from_numpy(arrays["expected.posed"])).abs().max().item()
    print(f"{len(posed)} vertices, at most {difference:.1e} m from the program's")

    part = lambda i, name: arrays[f"garment{i}.{name}"]
    count = len(about["garments"])
    scene = clothcombo.Scene(
        [(part(i, "rest"), part(i, "faces")) for i in range(count)],
        (arrays["body.positions"], arrays["body.faces"]),
        held=[garment["held"] for garment in about["garments"]],
    )
    loss, optimizer = PhysicsLoss(scene), torch.optim.Adam(networks.parameters(), 1e-4)
    for step in range(2):
        posed, canonical = networks(outfit)[:2]
        total, terms = loss(posed, canonical, sample=step)
        optimizer.zero_grad()
        total.backward()
        optimizer.step()
        print(f"step {step}: {total.item():.4f}", dict(zip(clothcombo.TERMS, (round(t, 6) for t in terms.tolist()))))
    return difference


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        raise SystemExit(__doc__)
    main(sys.argv[1])
