#!/usr/bin/env bash
# The other compute devices: loss and gradients beside flex, and a few steps of every stage of the smoke training.
#
#   scripts/check_backends.sh [FEATURES]        default: ndarray,wgpu
#
# Builds in target-gpu, 42 minutes on two busy cores: that is why CI does not run this. wgpu takes the first adapter it finds;
# without a GPU that may be Mesa's software one (Debian: mesa-vulkan-drivers libvulkan1), where only small sizes are right.
set -euo pipefail
cd "$(dirname "$0")/.."
features=${1:-ndarray,wgpu}
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-target-gpu} CUBECL_AUTOTUNE_LEVEL=${CUBECL_AUTOTUNE_LEVEL:-minimal}
cargo build --release --workspace --bins --features "$features"
"$CARGO_TARGET_DIR/release/clothcombo" bench backends --width 16 --layers 2 --vertices 300 --seconds 0.3
runs=$(mktemp -d)
trap 'rm -rf "$runs"' EXIT
for device in ${features//,/ }; do
    "$CARGO_TARGET_DIR/release/clothcombo-train" --config configs/smoke.toml --device "$device" --run-dir "$runs/$device" \
        --set stages.0.steps=15 --set stages.1.steps=5 --set stages.2.steps=5 --set stages.3.steps=5 \
        --set validation.single_scenes=2 --set validation.unseen_scenes=0 --set validation.layered_scenes=1 --quiet
    echo "$device: four stages trained"
done
