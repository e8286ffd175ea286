#!/usr/bin/env bash
# Everything that only a GPU can show, in one run of at most 8 minutes: agreement with the processor, steps per second, memory,
# the same step in PyTorch, where the time goes, a training, an exact resume. Without a GPU it checks itself in small.
#
#   scripts/gpu_check.sh OUT                                     writes OUT/report.json, OUT/report.md, OUT/log.txt
#   STAGES="2 3 4" scripts/gpu_check.sh OUT                      only these; the report keeps what an earlier run found
#   DEVICE=flex TORCH_DEVICE=cpu SIZE=tiny scripts/gpu_check.sh OUT     two minutes, no GPU
#
# 1  environment   GPU, driver, graphics API, processor
# 2  agreement     loss, positions and gradients of DEVICE beside flex: within 1e-4 and 1e-3 (relative)
# 3  steps         steps per second and peak memory: paper (width 512, 128 eigenpairs, 8,000 vertices, M = 1 to 6), shipped, smoke
# 4  PyTorch       the same cases on TORCH_DEVICE, first in f32, then with TF32; positions, loss and gradients must be ours
# 5  profile       a step of the paper's size by part, with all threads and with four
# 6  training      300 steps of configs/paper.toml, end to end, on 12 generated garments of 8,000 vertices; the loss must fall.
#                  Where the time is up the run ends early and the steps made count.
# 7  resume        all stages of configs/smoke.toml, 20 steps; again from the checkpoint at 10: the same networks, bit for bit
#
# Every stage prints one line, has a time limit and goes on where another failed; the exit code is 1 if any failed.
#
#   CLOTHCOMBO, CLOTHCOMBO_TRAIN   the built programs; unset: built here with --features FEATURES
#   FEATURES       default vulkan
#   DEVICE         default wgpu; of clothcombo bench step --device
#   TORCH_DEVICE   default cuda
#   SIZE           full (default) or tiny (width 16, 300 vertices, few steps)
#   PYTHON         an interpreter with numpy and torch, default python3; without torch only stage 4 fails
#   THREADS        default: all cores; tiny: 1
#   WORK           folder for logs, runs and the cache of operators, default OUT/work
#   LIMIT          seconds for all stages together, default 480
#
# The first use of a GPU compiles its kernels, and CUBECL_AUTOTUNE_LEVEL=minimal (the default here) keeps the search for the
# fastest ones short.
set -uo pipefail
usage() {
    echo "$1; see scripts/gpu_check.sh -h" >&2
    exit 2
}
case ${1:-} in
    "" | -[!h]*) usage "name a folder for the report" ;;
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
esac
out=$(mkdir -p "$1" && cd "$1" && pwd) || usage "cannot make the folder $1"
for name in CLOTHCOMBO CLOTHCOMBO_TRAIN; do
    [ -n "${!name:-}" ] || continue
    [ -x "${!name}" ] || usage "$name=${!name} is no program"
    printf -v "$name" %s "$(realpath "${!name}")"
done
cd "$(dirname "${BASH_SOURCE[0]}")/.."
device=${DEVICE:-wgpu} torch_device=${TORCH_DEVICE:-cuda} size=${SIZE:-full} python=${PYTHON:-python3}
stages=${STAGES:-1 2 3 4 5 6 7}
work=${WORK:-$out/work}
work=$(mkdir -p "$work" && cd "$work" && pwd) || usage "cannot make the folder $work"
[[ $size = full || $size = tiny ]] || usage "SIZE=$size is neither full nor tiny"
[[ $stages =~ ^[1-7](\ [1-7])*$ ]] || usage "STAGES=$stages are not some of 1 2 3 4 5 6 7"
[[ ${LIMIT:-480} =~ ^[0-9]+$ ]] || usage "LIMIT=$LIMIT is no number of seconds"
command -v "$python" >/dev/null || usage "PYTHON=$python is no program"
cache=(--set "data.cache.folder=$work/cache")
export LC_ALL=C CUBECL_AUTOTUNE_LEVEL=${CUBECL_AUTOTUNE_LEVEL:-minimal}

if [ -z "${CLOTHCOMBO:-}" ] || [ -z "${CLOTHCOMBO_TRAIN:-}" ]; then
    command -v cargo >/dev/null || { echo "set CLOTHCOMBO and CLOTHCOMBO_TRAIN: there is no cargo to build them" >&2; exit 2; }
    cargo build --release --workspace --bins --features "${FEATURES:-vulkan}" || exit 2
fi
ours=${CLOTHCOMBO:-${CARGO_TARGET_DIR:-target}/release/clothcombo}
train=${CLOTHCOMBO_TRAIN:-${CARGO_TARGET_DIR:-target}/release/clothcombo-train}

# Sizes of `bench step`: those of configs/paper.toml, of models/default and of configs/smoke.toml. All pairs of vertices repel,
# which PyTorch does as well.
if [ "$size" = tiny ]; then
    threads=${THREADS:-1} seconds=0.02 profiled=3 steps=300 rate=1e-3 garments=6 vertices=300 width=16
    paper=(--widths 16 --vertices 300 --set model.eigen_count=16)
    shipped=(--widths 16 --vertices 250 --layers 3 --set model.embedding=8)
    smoke=(--widths 16 --vertices 200 --layers 3)
    agreement=(--width 16 --layers 2 --vertices 300) large=(--width 32 --layers 2 --vertices 300)
else
    threads=${THREADS:-$(nproc)} seconds=0.3 profiled=8 steps=300 rate=1e-4 garments=12 vertices=8000 width=512
    paper=(--widths 512 --vertices 8000)
    shipped=(--widths 128 --vertices 1000 --layers 3 --set model.embedding=64 --set model.diffusion_width=96
        --set model.skinning_width=96 --set model.eigen_count=48)
    smoke=(--widths 48 --vertices 700 --layers 3 --set model.eigen_count=32 --set model.siren_layers=5
        --set model.skinning_layers=3 --set model.skinning_width=32)
    agreement=(--width 48 --layers 3 --vertices 700) large=(--width 512 --layers 2 --vertices 2000)
fi
export RAYON_NUM_THREADS=$threads
# The most telling sizes first, should the time not do for all.
cases=(paper-1 paper-3 paper-6 shipped smoke paper-2 paper-4 paper-5)

case_arguments() {
    case $1 in
        paper-*) arguments=("${paper[@]}" --layers "${1#paper-}") ;;
        shipped) arguments=("${shipped[@]}") ;;
        smoke) arguments=("${smoke[@]}") ;;
    esac
    arguments+=("${cache[@]}" --set optimizer.clip=step)
}

# Runs a command within what is left of the stage's time. SIGTERM first, with which a training saves and ends well; it must get
# just one, and timeout without --foreground sends it to the process and then to its group.
limited() {
    local left=$((deadline - SECONDS)) one=()
    [ "$1" != "$train" ] || one=(--foreground)
    [ "$left" -gt 0 ] || { echo "no time left for: $*" >&2; return 124; }
    timeout "${one[@]}" --preserve-status --kill-after=15 "$left" "$@"
}

# The memory used of the first GPU while a command runs, several times a second, into the file named first.
with_memory() {
    local file=$1 sampler= code=0
    shift
    if command -v nvidia-smi >/dev/null; then
        nvidia-smi -i 0 --query-gpu=memory.used --format=csv,noheader,nounits >"$file"
        nvidia-smi -i 0 --query-gpu=memory.used --format=csv,noheader,nounits -lms 100 >>"$file" &
        sampler=$!
    fi
    limited "$@" || code=$?
    [ -z "$sampler" ] || { kill "$sampler"; wait "$sampler"; } 2>/dev/null
    return "$code"
}

environment() {
    echo "threads $threads, device $device, PyTorch on $torch_device, size $size"
    "$ours" --version
    nvidia-smi || true
    vulkaninfo --summary || true
    "$python" -c 'import sys, torch; print("Python", sys.version.split()[0], "PyTorch", torch.__version__)' || true
    # What the program's graphics library says of adapters is not in its usual log.
    RUST_LOG=wgpu_core::instance=debug limited "$ours" bench step --widths 8 --layers 1 --vertices 200 --steps 1 \
        --seconds 0.01 --device "$device"
}

agreement() {
    local compare=("$ours" bench backends --json --devices "$device" --seconds 0.05) code=0
    limited "${compare[@]}" "${agreement[@]}" >"$work/backends.json" || code=$?
    # For information: networks of the paper's width add up rounding errors of their own.
    limited "${compare[@]}" "${large[@]}" --most-loss 1 --most-gradient 1 >"$work/backends-large.json" || true
    return "$code"
}

steps() {
    local code=0 name arguments
    for name in "${cases[@]}"; do
        case_arguments "$name"
        with_memory "$work/step-$name.memory" "$ours" bench step --json --device "$device" --steps "$profiled" \
            --seconds "$seconds" "${arguments[@]}" >"$work/step-$name.json" || code=$?
    done
    return "$code"
}

pytorch() {
    local code=0 name arguments tf32=()
    [ "$torch_device" = cpu ] || tf32=(--tf32)
    # The largest case takes longest: last.
    for name in paper-3 shipped paper-1 smoke paper-6; do
        case_arguments "$name"
        rm -f "$work/torch-$name.json"
        # One process a case: one that runs out of memory takes no other with it.
        with_memory "$work/torch-$name.memory" "$python" scripts/bench_torch.py --ours "$ours" --no-ours-timing \
            --torch-device "$torch_device" "${tf32[@]}" --threads "$threads" --rounds 1 --seconds "$seconds" \
            --json "$work/torch-$name.json" "${arguments[@]}" || code=$?
    done
    return "$code"
}

profile() {
    local code=0 arguments count
    case_arguments paper-3
    for count in "$threads" 4; do
        RAYON_NUM_THREADS=$count limited "$ours" bench step --json --device "$device" --steps "$profiled" --seconds 0.01 \
            "${arguments[@]}" >"$work/profile-$count.json" || code=$?
    done
    return "$code"
}

training() {
    rm -rf "$work/training"
    with_memory "$work/training.memory" "$train" --config configs/paper.toml --device "$device" --run-dir "$work/training" --quiet \
        --set data.body=mannequin "${cache[@]}" --set data.split.test=0 --set "model.width=$width" \
        --set "data.garments=[{generate={count=$garments,seed=1,vertices=$vertices}}]" \
        --set 'data.poses={encoding="axis_angle",remove_heading=false,max_self_intersection=10.0}' \
        --set "stages=[{name=\"end to end\",trains=\"all\",steps=$steps,layers=[1,6],learning_rate=$rate}]" \
        --set validation.single_scenes=0 --set validation.layered_scenes=0 --set validation.unseen_scenes=0 \
        --set output.metrics_every=1 --set output.tensorboard=false --set output.sample_scenes=0 \
        $([ "$size" = full ] || echo --set model.embedding=16 --set model.diffusion_width=16 --set model.siren_width=16 \
            --set model.skinning_width=16 --set model.eigen_count=16)
}

resume() {
    local run=$work/resume stage few=()
    for stage in 0 1 2 3; do few+=(--set "stages.$stage.steps=5"); done
    rm -rf "$run" "$work/uninterrupted.safetensors" "$work/resumed.safetensors"
    limited "$train" --config configs/smoke.toml --device "$device" --run-dir "$run" --quiet "${few[@]}" "${cache[@]}" \
        --set validation.single_scenes=1 --set validation.unseen_scenes=0 --set validation.layered_scenes=1 \
        --set output.checkpoint_every=10 --set output.keep_checkpoints=9 --set output.sample_scenes=1 || return
    # Where the time is up a training saves, and ends well.
    cp "$run/checkpoints/step-00000020/model.safetensors" "$work/uninterrupted.safetensors" || return
    rm -r "$run/checkpoints/step-00000020"
    limited "$train" --resume "$run/checkpoints/step-00000010" --device "$device" --quiet || return
    cp "$run/checkpoints/step-00000020/model.safetensors" "$work/resumed.safetensors" || return
    cmp "$work/uninterrupted.safetensors" "$work/resumed.safetensors"
}

end=$((SECONDS + ${LIMIT:-480}))
failed=
# NUMBER, NAME, seconds
stage() {
    [[ " $stages " == *" $1 "* ]] || return 0
    local began=$EPOCHREALTIME code=0
    deadline=$((SECONDS + $3 < end ? SECONDS + $3 : end))
    "$2" >"$work/$1-$2.log" 2>&1 || code=$?
    "$python" scripts/gpu_check.py stage "$out" "$work" "$1" "$2" "$began" "$code" || failed="$failed $2"
}

{
    stage 1 environment 30
    stage 2 agreement 60
    stage 3 steps 140
    stage 4 pytorch 170
    stage 5 profile 40
    stage 6 training 130
    stage 7 resume 45
    "$python" scripts/gpu_check.py report "$out" || failed="$failed report"
    [ -z "$failed" ] || echo "failed:$failed"
} > >(tee "$out/log.txt") 2>&1
wait
[ -z "$failed" ]
