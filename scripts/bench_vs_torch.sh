#!/usr/bin/env bash
# Training and draping beside PyTorch: forward, forward + backward, whole step, losses, drape latency and peak memory, by
# default at widths 64, 128 and 512 with 1, 3 and 6 garments (half an hour on two cores); docs/performance.md has the rows of
# --widths 128,512 --layers 3 (seven minutes). Nothing else should run meanwhile.
#
#   scripts/bench_vs_torch.sh [options of bench_torch.py] > tables.md
#
# PYTHON names an interpreter with numpy and torch.
set -euo pipefail
cd "$(dirname "$0")/.."
# All members together: the features of shared dependencies, and so their builds, are those of every other command.
cargo build --release --workspace --bins >&2
exec "${PYTHON:-python3}" scripts/bench_torch.py --ours "${CARGO_TARGET_DIR:-target}/release/clothcombo" "$@"
