#!/usr/bin/env bash
# Every script that a document names, at its smallest size; of those that need a GPU, the network or an hour, the help. Fails,
# too, if a document names one that is not run here. About a minute after the build.
#
#   scripts/check_scripts.sh RUN REPORT     a run with two checkpoints, and a report of clothcombo eval
#
# PYTHON names an interpreter with numpy, scipy, blake3 and pillow (default python3).
set -uo pipefail
[ $# -eq 2 ] || { sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 2; }
run=$(realpath "$1") report=$(realpath "$2")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PYTHON=${PYTHON:-python3}
programs=${CARGO_TARGET_DIR:-target}/release
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=()
ran=" "

# check NAME COMMAND…: runs the command, quietly unless it fails.
check() {
    local name=$1 start=$SECONDS
    shift
    ran+="scripts/$name "
    if "$@" >"$work/log" 2>&1; then
        echo "$name: $((SECONDS - start)) s"
    else
        failed+=("$name")
        echo "$name: FAILED: $*"
        tail -n 20 "$work/log"
    fi
}

score_oracle() {
    local fixtures=tests/fixtures/score/outfit names=(shirt sweater coat) kind
    local -A files
    for kind in rest draped; do files[$kind]=$(printf "$fixtures/$kind/%s.obj " "${names[@]}"); done
    # shellcheck disable=SC2086
    set -- --body "$fixtures/body.obj" --rest ${files[rest]} --draped ${files[draped]}
    "$programs/clothcombo" score "$@" --json >"$work/score.json" && "$PYTHON" scripts/score_oracle.py "$@" --compare "$work/score.json"
}

bench_operators() {
    cargo build --release --workspace --example operators && "$PYTHON" scripts/bench_operators.py \
        --vertices 300 --eigen-count 16 --repeats 1 --program "$programs/examples/operators"
}

gpu_check() {
    scripts/gpu_check.sh -h && env CLOTHCOMBO="$programs/clothcombo" CLOTHCOMBO_TRAIN="$programs/clothcombo-train" SIZE=tiny \
        DEVICE=flex STAGES="1 2 5" scripts/gpu_check.sh "$work/gpu"
}

check bench_energies.sh scripts/bench_energies.sh --no-torch --sizes 500 --rounds 1 --seconds 0.01
check bench_operators.py bench_operators
check bench_vs_torch.sh scripts/bench_vs_torch.sh --read --widths 16 --layers 2 --vertices 200
check check_backends.sh scripts/check_backends.sh -h
check check_blender.py "$PYTHON" scripts/check_blender.py --help
check check_python.sh scripts/check_python.sh -h
check figures.py "$PYTHON" scripts/figures.py --help
check gpu_check.sh gpu_check
check kill_test.sh scripts/kill_test.sh 1
check open_data.sh scripts/open_data.sh --help
check results_page.py "$PYTHON" scripts/results_page.py --check "$report"
check score_oracle.py score_oracle
check smpl_pickle_to_npz.py "$PYTHON" scripts/check_smpl_pickle.py
check motion_pickle_to_npz.py "$PYTHON" scripts/motion_pickle_to_npz.py --help
check fuzz.sh scripts/fuzz.sh -h

for name in $(grep -oh 'scripts/[a-z0-9_]*\.\(sh\|py\)' README.md ARCHITECTURE.md docs/*.md models/default/README.md | sort -u); do
    [[ $ran == *" $name "* ]] || { failed+=("$name"); echo "$name is named by a document and not run here"; }
done
[ "${#failed[@]}" -eq 0 ]
