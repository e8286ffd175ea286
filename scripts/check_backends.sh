#!/usr/bin/env bash
# The other compute devices, one line per check: every kernel beside f64, loss and gradients beside flex, a small training of
# every stage, and an exact resume of it.
#
#   scripts/check_backends.sh [FEATURES]        default: ndarray,wgpu
#
# kernels     the tests of the fused operations, in a build of the networks whose only device is the GPU
# agreement   clothcombo bench backends: loss within 1e-4, gradients within 1e-3 (relative)
# training    all four stages of configs/smoke.toml, five tiny steps of each, with checkpoints
# resume      again from the checkpoint after ten of those steps: the same networks, bit for bit
#
# Builds in target-gpu, about an hour on two busy cores: that is why CI does not run this. wgpu takes the first adapter it
# finds; without a GPU that may be Mesa's software one (Debian: mesa-vulkan-drivers libvulkan1), which wants the sizes here and
# WGSL: the SPIR-V of the feature vulkan crashes it.
#
#   CLOTHCOMBO, CLOTHCOMBO_TRAIN   the programs, built with FEATURES; unset: built here
#   KERNEL_TESTS                   the tests of the kernels, built; unset: built here, or left out where the programs are given
#
# The exit code is 1 if any check failed; its log is printed.
set -uo pipefail
case ${1:-} in
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
esac
for name in CLOTHCOMBO CLOTHCOMBO_TRAIN KERNEL_TESTS; do
    [ -z "${!name:-}" ] || printf -v "$name" %s "$(realpath "${!name}")"
done
cd "$(dirname "${BASH_SOURCE[0]}")/.."
features=${1:-ndarray,wgpu}
export LC_ALL=C CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target-gpu} CUBECL_AUTOTUNE_LEVEL=${CUBECL_AUTOTUNE_LEVEL:-minimal}
# Mesa asks for it.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}
built=yes
if [ -z "${CLOTHCOMBO:-}" ] || [ -z "${CLOTHCOMBO_TRAIN:-}" ]; then
    built=
    cargo build --release --workspace --bins --features "$features" || exit 2
fi
ours=${CLOTHCOMBO:-$CARGO_TARGET_DIR/release/clothcombo}
train=${CLOTHCOMBO_TRAIN:-$CARGO_TARGET_DIR/release/clothcombo-train}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
log=$work/log
failed=

# Runs a check and prints its line: NAME, what it measured (its last line on descriptor 3), seconds.
check() {
    local name=$1 began=$SECONDS found code=0
    shift
    found=$("$@" 3>&1 >"$log" 2>&1) || code=$?
    if [ "$code" = 0 ]; then
        echo "$name: $found ($((SECONDS - began)) s)"
    else
        echo "$name: FAILED, exit code $code"
        sed 's/^/    /' "$log"
        failed="$failed, $name"
    fi
}

# FEATURE
kernels() {
    local tests=("${KERNEL_TESTS:-}" ops)
    if [ -z "${KERNEL_TESTS:-}" ]; then
        tests=(cargo test --release -p clothcombo-model --no-default-features --features "$1" --lib ops)
    fi
    "${tests[@]}" || return
    sed -n 's/^test result: ok\. \([0-9]* passed\);.*/\1/p' "$log" >&3
}

# DEVICE
agreement() {
    "$ours" bench backends --devices "$1" --width 16 --layers 2 --vertices 300 --seconds 0.05 || return
    awk -F ' *[|] *' -v device="$1" '$2 == device { print "loss", $4, "gradients", $6 }' "$log" >&3
}

training() {
    local run=$work/$1 stage tiny=()
    for stage in 0 1 2; do tiny+=(--set "stages.$stage.steps=5"); done
    for key in width embedding diffusion_width siren_width skinning_width eigen_count; do
        tiny+=(--set "model.$key=16")
    done
    "$train" --config configs/smoke.toml --device "$1" --run-dir "$run" --quiet "${tiny[@]}" \
        --set 'data.garments=[{generate={count=6,seed=1,vertices=200}}]' --set "data.cache.folder=$work/cache" \
        --set validation.single_scenes=1 --set validation.unseen_scenes=0 --set validation.layered_scenes=1 \
        --set output.checkpoint_every=10 --set output.keep_checkpoints=9 --set output.sample_scenes=0 || return
    cp "$run/checkpoints/step-00000020/model.safetensors" "$work/uninterrupted.safetensors" || return
    # The resumed run has to write it again.
    rm -r "$run/checkpoints/step-00000020"
    echo "four stages" >&3
}

resume() {
    local run=$work/$1
    "$train" --resume "$run/checkpoints/step-00000010" --device "$1" --quiet || return
    cmp "$work/uninterrupted.safetensors" "$run/checkpoints/step-00000020/model.safetensors" || return
    echo "the same networks, bit for bit" >&3
}

devices=
for feature in ${features//,/ }; do
    case $feature in
        vulkan) device=wgpu ;;
        *) device=$feature ;;
    esac
    if [[ $feature =~ ^(wgpu|vulkan|cuda)$ ]]; then
        if [ -n "$built" ] && [ -z "${KERNEL_TESTS:-}" ]; then
            echo "$feature kernels: left out, KERNEL_TESTS is unset"
        else
            check "$feature kernels" kernels "$feature"
        fi
    fi
    [[ " $devices " == *" $device "* ]] || devices="$devices $device"
done
for device in $devices; do
    check "$device agreement" agreement "$device"
    check "$device training" training "$device"
    check "$device resume" resume "$device"
done
[ -z "$failed" ] || { echo "failed: ${failed#, }"; exit 1; }
