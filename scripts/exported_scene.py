#!/usr/bin/env python3
"""A scene and its networks as `clothcombo bench step --export` writes them, read with numpy alone; what the PyTorch peer
(bench_torch.py) does not implement is named.

    clothcombo bench step --widths 16 --layers 2 --vertices 200 --export FOLDER --export-only
    python3 scripts/exported_scene.py FOLDER
"""

import json
import struct
import sys

import numpy as np

# What the PyTorch networks heed of `model`, and the one value of other keys that they implement.
MODEL = {
    "width", "embedding", "diffusion_blocks", "diffusion_width", "eigen_count", "mlp_layers", "siren_layers", "siren_width",
    "omega_first", "omega_hidden", "skinning_layers", "skinning_width", "displacement_scale", "untangling_scale",
    "skinning_scale", "zero_sum_skinning", "vertex_embedding",
    "graph", "skinning_joints",
}
# What the PyTorch losses heed, with the values of a scene that says nothing.
SETTINGS = {
    "thickness": 4.7e-4, "density": 426.0, "mu": 2.36e4, "lambda": 4.44e4, "bending_stiffness": 3.96e-5, "gravity": 9.81,
    "radius": 0.1, "body_epsilon": 0.002, "layer_epsilon": 0.002, "layer_radius": 0.1, "holding_fraction": 0.1,
    "gate_depth": 0.05, "gate_edges": 0.75, "repulsion_per_vertex": True,
}
GARMENT_TERMS = ["strain", "bending", "gravity", "body_collision", "repulsion", "holding"]
LAYER_TERMS = ["layer_collision", "layer_distance"]


def read_safetensors(path):
    """The tensors of a file by name."""
    with open(path, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
        data = file.read()
    arrays = {}
    for name, entry in header.items():
        if name != "__metadata__":
            begin, end = entry["data_offsets"]
            assert entry["dtype"] == "F32", name
            arrays[name] = np.frombuffer(data[begin:end], "<f4").reshape(entry["shape"]).copy()
    return arrays


def not_implemented(about):
    """Switches of an exported run that the peer would ignore. One that it has never heard of must be off."""
    model, settings = about["model"], about["settings"]
    found = [f"model.{key} = {value}" for key, value in model.items() if key not in MODEL and value]
    found += [f"{key} = {value}" for key, value in settings.items() if key not in SETTINGS | {"distance": 0} and value]
    if about["trains"] not in ("single", "all"):
        found.append(f"stages.trains = {about['trains']}")
    if not model["vertex_embedding"]:
        found.append("model.vertex_embedding = false")
    if settings["distance"] != "nearest_vertex":
        found.append(f"losses.body_collision.distance = {settings['distance']}")
    weights = [part["weights"] for part in about["garments"] + about["layers"]]
    terms = {term for part in weights for term in part} - set(GARMENT_TERMS + LAYER_TERMS)
    return found + [f"losses.{term}" for term in sorted(terms)]


class ExportedScene:
    """Description, arrays and parameters of one case."""

    def __init__(self, folder):
        with open(f"{folder}/scene.json") as file:
            self.about = json.load(file)
        if unknown := not_implemented(self.about):
            raise SystemExit("the PyTorch side does not implement " + ", ".join(unknown))
        self.arrays = np.load(f"{folder}/scene.npz")
        self.parameters = read_safetensors(f"{folder}/model.safetensors")

    def check(self):
        """Stops unless all numbers are finite and every garment is whole."""
        numbers = {name: self.arrays[name] for name in self.arrays.files} | self.parameters
        wrong = [name for name, x in numbers.items() if x.dtype.kind == "f" and not np.isfinite(x).all()]
        vertices = 0
        for i in range(len(self.about["garments"])):
            part = lambda name: self.arrays[f"garment{i}.{name}"]
            count = len(part("rest"))
            vertices += count
            lengths = ("mass", "eigenvectors", "skin_weights")
            wrong += [f"garment{i}.{name}" for name in lengths if len(part(name)) != count]
            wrong += [f"garment{i}.{name}" for name in ("faces", "gradient_x.rows") if part(name).max() >= count]
        if self.arrays["expected.posed"].shape != (vertices, 3):
            wrong.append("expected.posed")
        if wrong:
            raise SystemExit(f"not as they should be: {', '.join(wrong)}")
        parameters = sum(x.size for x in self.parameters.values())
        return f"{len(self.about['garments'])} garments, {vertices} vertices, {parameters} parameters"


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        raise SystemExit(__doc__)
    print(ExportedScene(sys.argv[1]).check())
