#!/usr/bin/env bash
# Kills a training run with SIGKILL (or the signal given) at random moments, resumes it each time, and compares the final
# networks with those of a run that was left alone: they must be the same bytes. With one and with two threads.
#
#   scripts/kill_test.sh [KILLS] [SIGNAL]     default: 20 KILL; for example 20 TERM
#
# Needs target/release/clothcombo-train (or PROGRAM). Some minutes on two cores. SEED=n chooses other moments.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
kills=${1:-20}
signal=${2:-KILL}
RANDOM=${SEED:-1}
program=${PROGRAM:-target/release/clothcombo-train}
[ -x "$program" ] || { echo "$program is missing: cargo build --release" >&2; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Six hundred small steps in three stages with a checkpoint every ten: a good part of the time goes into saves.
run_arguments=(--config tests/fixtures/tiny.toml --set stages.0.steps=200 --set stages.1.steps=200 --set stages.2.steps=200
    --set optimizer.ema_decay=0.9 --set validation.every=70 --set output.sample_scenes=1)

final=checkpoints/step-00000600
# The networks and what Adam and the average remember, which the next run would start from.
digest() { (cd "$1/$final" && sha256sum model.safetensors && sed -n '/"best"/,/}/p' state.json); }
milliseconds() { echo $(($(date +%s%N) / 1000000)); }

began=$(milliseconds)
RAYON_NUM_THREADS=2 "$program" "${run_arguments[@]}" --run-dir "$work/whole" --quiet
whole=$(($(milliseconds) - began))
expected=$(digest "$work/whole")
echo "left alone: $whole ms, $(echo "$expected" | head -n 1 | cut -c 1-16)"

failures=0
for threads in 1 2; do
    landed=0
    in_saves=0
    number=0
    while [ "$landed" -lt "$kills" ]; do
        number=$((number + 1))
        run=$work/killed-$threads-$number
        moments=
        # A run that gets to its end between kills is compared, and the next one takes the other kills.
        while [ "$landed" -lt "$kills" ] && [ ! -d "$run/$final" ]; do
            if [ -f "$run/config.toml" ]; then
                arguments=(--resume "$run")
            else
                arguments=("${run_arguments[@]}" --run-dir "$run")
            fi
            RAYON_NUM_THREADS=$threads "$program" "${arguments[@]}" --quiet 2>/dev/null &
            child=$!
            sleep "$(awk -v w="$whole" -v r="$RANDOM" 'BEGIN { printf "%.3f", (300 + r / 32768 * w / 8) / 1000 }')"
            if kill "-$signal" "$child" 2>/dev/null; then
                landed=$((landed + 1))
                wait "$child" 2>/dev/null || true
                if compgen -G "$run/checkpoints/*.tmp" >/dev/null; then in_saves=$((in_saves + 1)); fi
                newest=$(cat "$run/checkpoints/latest" 2>/dev/null || echo none)
                moments="$moments ${newest#step-00000}"
            else
                wait "$child" || { echo "the run failed by itself" >&2; exit 1; }
            fi
        done
        RAYON_NUM_THREADS=$threads "$program" --resume "$run" --quiet 2>/dev/null ||
            RAYON_NUM_THREADS=$threads "$program" "${run_arguments[@]}" --run-dir "$run" --quiet
        found=$(digest "$run")
        if [ "$found" = "$expected" ]; then result="bit-identical"; else result="DIFFERENT"; failures=$((failures + 1)); fi
        echo "$threads threads, run $number: killed with these checkpoints:${moments:- never}: $result"
        rm -rf "$run"
    done
    echo "$threads threads: $landed kills, $in_saves of them inside a save"
done
if [ "$failures" -gt 0 ]; then
    echo "$failures runs ended with other networks" >&2
    exit 1
fi
