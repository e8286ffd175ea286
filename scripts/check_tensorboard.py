#!/usr/bin/env python3
"""Reads the event files of a run with TensorBoard's own reader and compares them with metrics.jsonl.

    pip install tensorboard
    scripts/check_tensorboard.py RUN
"""

import json
import pathlib
import struct
import sys

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

run = pathlib.Path(sys.argv[1])
events = EventAccumulator(str(run / "tensorboard"), size_guidance={"scalars": 0, "images": 0, "tensors": 0})
events.Reload()
tags = events.Tags()

lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
single = lambda value: struct.unpack("<f", struct.pack("<f", value))[0]
compared = 0
series = {"loss/weighted": lambda l: l["loss"], "gradient/norm": lambda l: l["grad_norm"], "schedule/learning_rate": lambda l: l["lr"]}
for term in lines[-1]["raw"]:
    series[f"raw/{term}"] = lambda l, term=term: l["raw"].get(term)
for tag, value in series.items():
    expected = [(l["step"], single(value(l))) for l in lines if value(l) is not None]
    found = [(e.step, e.value) for e in events.Scalars(tag)]
    assert found == expected, f"{tag}: {len(found)} points, {len(expected)} lines; first difference " + str(
        next(((f, e) for f, e in zip(found, expected) if f != e), None))
    compared += len(found)
assert any(tag.startswith("validation, ") for tag in tags["scalars"]), tags["scalars"]
pictures = [e for tag in tags["images"] for e in events.Images(tag)]
assert pictures and all(e.encoded_image_string.startswith(b"\x89PNG") and e.width > 0 for e in pictures), tags
print(f"{len(tags['scalars'])} scalar tags, {compared} points equal to metrics.jsonl, {len(pictures)} pictures")
