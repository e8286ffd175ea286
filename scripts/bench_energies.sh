#!/usr/bin/env bash
# Tables of docs/performance.md for the energies: ours beside PyTorch, and growth with the garment. About ten minutes on two
# cores; nothing else should run meanwhile.
#
#   scripts/bench_energies.sh [options of bench_energies_torch.py] > tables.md
#
# PYTHON names an interpreter with numpy and torch (see bench_energies_torch.py; --no-torch needs numpy only).
set -euo pipefail
cd "$(dirname "$0")/.."
# All members together: the features of shared dependencies, and so their builds, are those of every other command.
cargo build --release --workspace --example energy_times >&2
exec "${PYTHON:-python3}" scripts/bench_energies_torch.py \
    --ours "${CARGO_TARGET_DIR:-target}/release/examples/energy_times" "$@"
