#!/usr/bin/env bash
# Several processes are one run: 24 steps over all three stages by `mpirun -n 2`, each process with one outfit per step, give
# the parameters (relative 1e-5) of one process that accumulates both outfits; an error in one process ends all of them with
# one message. Needs an MPI library with its headers (Debian: libopenmpi-dev openmpi-bin), libclang (libclang-dev) and python3.
# About a minute after the build.
#
#   scripts/mpi_test.sh [processes, default 2]
set -euo pipefail
cd "$(dirname "$0")/.."
processes=${1:-2}

# All members together: the features of shared dependencies, and so their builds, are those of every other command.
cargo build --release --workspace --features mpi --bin clothcombo-train >&2
train=${CARGO_TARGET_DIR:-target}/release/clothcombo-train
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ "$(id -u)" -eq 0 ]; then
    # Open MPI asks twice before it runs as root, as containers do.
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
fi
mpi=(mpirun --oversubscribe -n "$processes")
short=(--quiet --config configs/smoke.toml
    --set stages.0.steps=8 --set stages.1.steps=8 --set stages.2.steps=8
    --set validation.single_scenes=1 --set validation.layered_scenes=1)
for stage in 0 1 2; do
    short+=(--set "stages.$stage.accumulate=$processes")
done

"$train" "${short[@]}" --run-dir "$work/one"
"${mpi[@]}" "$train" "${short[@]}" --run-dir "$work/shared"
python3 - "$work" <<'PYTHON'
import array, glob, json, math, os, struct, sys

def tensors(run):
    path = max(glob.glob(os.path.join(sys.argv[1], run, "checkpoints", "step-*", "model.safetensors")))
    with open(path, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
        data = file.read()
    found = {}
    for name, entry in header.items():
        if name != "__metadata__":
            assert entry["dtype"] == "F32", (name, entry["dtype"])
            found[name] = array.array("f", data[slice(*entry["data_offsets"])])
    return os.path.basename(os.path.dirname(path)), found

def lines(run):
    with open(os.path.join(sys.argv[1], run, "metrics.jsonl")) as file:
        return [json.loads(line) for line in file]

(one_step, one), (shared_step, shared) = tensors("one"), tensors("shared")
assert one_step == shared_step == "step-00000024", (one_step, shared_step)
assert one.keys() == shared.keys()
norm = lambda values: math.sqrt(sum(value * value for value in values))
worst, different, count = (0.0, ""), 0, 0
for name, expected in one.items():
    found = shared[name]
    assert len(found) == len(expected), name
    apart = norm(a - b for a, b in zip(found, expected)) / max(norm(expected), 1e-30)
    worst = max(worst, (apart, name))
    different += sum(a != b for a, b in zip(found, expected))
    count += len(expected)
print(f"parameters: {count}, of which {different} differ; largest relative difference of a tensor {worst[0]:.2e} {worst[1]}")
assert worst[0] <= 1e-5, "the processes did not train what one process trains"
losses = [[line["loss"] for line in lines(run)] for run in ("one", "shared")]
apart = max(abs(a - b) / abs(a) for a, b in zip(*losses))
print(f"steps in the log: {[len(x) for x in losses]}, largest relative difference of a loss {apart:.2e}")
assert len(losses[0]) == len(losses[1]) == 24 and apart <= 1e-5
PYTHON

# once MESSAGE COMMAND…: the command fails in time and says MESSAGE exactly once.
once() {
    local message=$1 status=0 found
    shift
    timeout 120 "$@" >"$work/output" 2>&1 || status=$?
    # The report may break the line anywhere.
    found=$(tr -s ' │\n' ' ' <"$work/output" | { grep -o "$message" || true; } | wc -l)
    if [ "$status" -eq 0 ] || [ "$status" -eq 124 ] || [ "$found" -ne 1 ]; then
        echo "expected one \"$message\" and a failure; got $found, status $status:" >&2
        cat "$work/output" >&2
        return 1
    fi
    echo "one message: $message"
}
# The same error in all processes, errors of the leader or of another one alone, before and after the others wait.
once "unknown field" "${mpi[@]}" "$train" --config configs/smoke.toml --set data.nonsense=1 --run-dir "$work/wrong"
once "already holds a run" "${mpi[@]}" "$train" "${short[@]}" --run-dir "$work/shared"
once "cannot share equally" "${mpi[@]}" "$train" "${short[@]}" --set stages.1.accumulate=1 --run-dir "$work/unequal"
once "unexpected argument" "${mpi[@]}" "$train" --nonsense
once "cannot read" mpirun --oversubscribe -n 1 "$train" "${short[@]}" --run-dir "$work/alone" : \
    -n $((processes - 1)) "$train" --quiet --config "$work/missing.toml" --run-dir "$work/alone"
