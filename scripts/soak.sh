#!/usr/bin/env bash
# Trains under conditions nobody would choose: the smoke configuration at ten times the paper's learning rate,
# poses exaggerated to 1.2, shapes to ±3. No parameter may ever stop being finite.
#
#   scripts/soak.sh [STEPS] [RUN]     default: 20000 steps into runs/soak
#
# Needs target/release/clothcombo-train (or PROGRAM) and python3. Resumes RUN if it is there. Low priority, one thread; hours.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
steps=${1:-20000}
run=${2:-runs/soak}
single=$((steps * 7 / 10))
untangling=$((steps * 2 / 10))
all=$((steps - single - untangling))
settings=(
    --set "stages.0.steps=$single" --set "stages.1.steps=$untangling" --set "stages.2.steps=$all"
    # The paper's 1e-4 times ten.
    --set "stages.0.learning_rate=1e-3" --set "stages.1.learning_rate=1e-3" --set "stages.2.learning_rate=1e-3"
    --set "stages.0.pose_scale=1.2" --set "stages.1.pose_scale=1.2" --set "stages.2.pose_scale=1.2"
    --set "data.shape_range=[-3.0, 3.0]" --set "validation.every=$((steps / 10))"
)
export RAYON_NUM_THREADS=${RAYON_NUM_THREADS:-1}
program=${PROGRAM:-target/release/clothcombo-train}
if [ -d "$run" ]; then
    nice -n 19 "$program" --resume "$run"
else
    nice -n 19 "$program" --config configs/smoke.toml --run-dir "$run" "${settings[@]}"
fi
python3 - "$run" <<'PYTHON'
import json, math, pathlib, struct, sys

run = pathlib.Path(sys.argv[1])
lines = [json.loads(l) for l in (run / "metrics.jsonl").read_text().splitlines()]
skipped = [l["step"] for l in lines if l.get("skipped")]
wild = [l["step"] for l in lines if not l.get("skipped") and not all(
    v is not None and math.isfinite(v) for v in [l["loss"], l["grad_norm"], *l["raw"].values()])]
norms = sorted(l["grad_norm"] for l in lines if l["grad_norm"] is not None)
checkpoint = run / "checkpoints" / (run / "checkpoints/latest").read_text().strip()
data = (checkpoint / "model.safetensors").read_bytes()
size = struct.unpack("<Q", data[:8])[0]
header = json.loads(data[8 : 8 + size])
bad = total = 0
for name, tensor in header.items():
    if name == "__metadata__":
        continue
    assert tensor["dtype"] == "F32", tensor["dtype"]
    first, last = tensor["data_offsets"]
    values = struct.unpack(f"<{(last - first) // 4}f", data[8 + size + first : 8 + size + last])
    total += len(values)
    bad += sum(not math.isfinite(v) for v in values)
print(f"{lines[-1]['step']} steps, {len(skipped)} skipped {skipped[:10]}, gradient norm median {norms[len(norms) // 2]:.3g}, "
      f"largest {norms[-1]:.3g}; {total} parameters, {bad} not finite; {len(wild)} steps with an energy that is not finite")
sys.exit(bool(bad or wild))
PYTHON
