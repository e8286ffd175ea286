#!/usr/bin/env bash
# The long form of what the tests do briefly: damaged configurations, damaged checkpoints, messy garments, SIGTERM and SIGKILL at random.
#
#   scripts/fuzz.sh [CASES]     default: 200000 configurations, that / 20 checkpoints, that / 200 garments
#
# SEED=n chooses other cases; a failing case prints what it was.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cases=${1:-200000}
export CLOTHCOMBO_FUZZ_SEED=${SEED:-1}
CLOTHCOMBO_FUZZ_CASES=$cases cargo test --release --workspace --test contracts config_fuzz:: -- --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 20)) cargo test --release --workspace --test contracts checkpoint:: -- damaged --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 200)) cargo test --release --workspace --test contracts messy_garments:: -- --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 200)) cargo test --release --workspace --test contracts placement:: -- --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 50)) cargo test --release --workspace --test contracts other_objects:: -- --nocapture
scripts/kill_test.sh 20 TERM
scripts/kill_test.sh 20 KILL
