#!/usr/bin/env bash
# Training and draping beside PyTorch, the tables of docs/performance.md: forward, forward + backward, whole step, losses,
# drape latency and peak memory at widths 64, 128 and 512 with 1, 3 and 6 garments. Nothing else should run meanwhile;
# about half an hour on two cores, most of it at width 512.
#
#   scripts/bench_vs_torch.sh [options of bench_torch.py] > tables.md
#
# PYTHON names an interpreter with numpy and torch.
set -euo pipefail
cd "$(dirname "$0")/.."
# All members together: the features of shared dependencies, and so their builds, are those of every other command.
cargo build --release --workspace --bins >&2
exec "${PYTHON:-python3}" scripts/bench_torch.py --ours "${CARGO_TARGET_DIR:-target}/release/clothcombo" "$@"
