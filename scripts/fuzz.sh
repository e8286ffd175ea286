#!/usr/bin/env bash
# The long form of what the tests do briefly: damaged configurations, damaged checkpoints, messy garments, SIGTERM and SIGKILL at random.
#
#   scripts/fuzz.sh [CASES [KILLS]]     default: 200000 configurations, that / 20 checkpoints, that / 200 garments; 20 kills
#
# SEED=n chooses other cases; a failing case prints what it was.
set -euo pipefail
case ${1:-} in
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cases=${1:-200000}
kills=${2:-20}
export CLOTHCOMBO_FUZZ_SEED=${SEED:-1}
CLOTHCOMBO_FUZZ_CASES=$cases cargo test --release --workspace --test contracts config_fuzz:: -- --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 20)) cargo test --release --workspace --test contracts checkpoint:: -- damaged --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 200)) cargo test --release --workspace --test contracts messy_garments:: -- --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 200)) cargo test --release --workspace --test contracts placement:: -- --nocapture
CLOTHCOMBO_FUZZ_CASES=$((cases / 50)) cargo test --release --workspace --test contracts other_objects:: -- --nocapture
scripts/kill_test.sh "$kills" TERM
scripts/kill_test.sh "$kills" KILL
