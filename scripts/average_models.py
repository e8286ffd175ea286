#!/usr/bin/env python3
"""Writes a model whose parameters are the mean of those of two others, which must have begun as one.

Two runs that continue the same model, on other scenes or with other weights of the losses, often average to a model that is
better than either (Wortsman et al., "Model soups"). Configuration and state are those of the second.

    scripts/average_models.py runs/a/checkpoints/step-00003000 runs/b/checkpoints/step-00000650 models/mean   # numpy, blake3
"""

import json
import pathlib
import shutil
import struct
import sys

import blake3
import numpy

MODEL, STATE, CONFIG = "model.safetensors", "state.json", "config.toml"
SEAL = ',\n  "seal": "'


def read(folder: pathlib.Path) -> tuple[bytes, dict, bytes]:
    """Header bytes, the description of every tensor, and their numbers (safetensors)."""
    data = (folder / MODEL).read_bytes()
    end = 8 + struct.unpack("<Q", data[:8])[0]
    tensors = json.loads(data[8:end])
    tensors.pop("__metadata__", None)
    return data[:end], tensors, data[end:]


def mean(first: pathlib.Path, second: pathlib.Path) -> bytes:
    """The file of the mean, with the header of the second."""
    _, own, numbers = read(first)
    header, tensors, others = read(second)
    kinds = [{name: (t["dtype"], t["shape"]) for name, t in part.items()} for part in (own, tensors)]
    if kinds[0] != kinds[1] or any(dtype != "F32" for dtype, _ in kinds[0].values()):
        sys.exit(f"{first} and {second} are not the same networks")
    result = bytearray(others)
    for name, tensor in tensors.items():
        (a, b), (c, d) = own[name]["data_offsets"], tensor["data_offsets"]
        parts = numpy.frombuffer(numbers[a:b], "<f4"), numpy.frombuffer(others[c:d], "<f4")
        result[c:d] = (0.5 * (parts[0] + parts[1])).astype("<f4").tobytes()
    return header + bytes(result)


def main() -> None:
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    first, second, target = map(pathlib.Path, sys.argv[1:])
    model = mean(first, second)
    target.mkdir(parents=True)
    (target / MODEL).write_bytes(model)
    shutil.copy(second / CONFIG, target / CONFIG)
    # The description holds the checksum of the parameters, and ends with its own.
    state = (second / STATE).read_text()
    state = state.replace(json.loads(state)["checksums"][MODEL], blake3.blake3(model).hexdigest())
    state = state[: state.index(SEAL)]
    (target / STATE).write_text(f'{state}{SEAL}{blake3.blake3(state.encode()).hexdigest()}"\n}}\n')


if __name__ == "__main__":
    main()
