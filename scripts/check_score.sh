#!/usr/bin/env bash
# Compares `clothcombo score` with scripts/score_oracle.py on real garments of the open data, posed on the real body.
set -euo pipefail

usage() {
    cat <<'TEXT'
usage: scripts/check_score.sh [--data DIR] [--keep DIR] [--help]

Poses garments of the open data (scripts/open_data.sh) on the Anny body by linear blend skinning, one outfit per body
shape and frame of motion, scores every outfit with `clothcombo score --json`, recomputes it with the numpy oracle and
prints both values and their relative difference for every energy. Holding is not in a score and not compared here (the
goldens of tests/fixtures/score hold it). Exit status 1 if a difference exceeds 1e-6. Needs python3 with numpy.

  --data DIR   the open data                 (default: datasets/open)
  --keep DIR   write meshes and scores here  (default: a temporary folder)
TEXT
}

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
data=$root/datasets/open
keep=
while [ $# -gt 0 ]; do
    case $1 in
    --data | --keep)
        [ $# -ge 2 ] || { echo "check_score: $1 needs a directory" >&2; exit 2; }
        if [ "$1" = --data ]; then data=$2; else keep=$2; fi
        shift 2
        ;;
    -h | --help) usage; exit 0 ;;
    *) echo "check_score: unknown argument '$1' (see --help)" >&2; exit 2 ;;
    esac
done
if [ ! -f "$data/body.npz" ]; then
    echo "check_score: $data/body.npz is missing; scripts/open_data.sh makes the open data" >&2
    exit 1
fi
data=$(cd "$data" && pwd)
if [ -n "$keep" ]; then
    mkdir -p "$keep"
    work=$(cd "$keep" && pwd)
else
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
fi

cd "$root"
cargo build --quiet --release -p clothcombo-trainer --bin clothcombo --example pose_garments
target=${CARGO_TARGET_DIR:-target}
sed "s|datasets/open|$data|" configs/open.toml >"$work/config.toml"

failed=()
check() { # OUTFIT MOTION FRAME SHAPE GARMENT...
    local name=$1 motion=$2 frame=$3 shape=$4 folder=$work/$1
    shift 4
    local garments=("$@")
    echo "== $name: ${garments[*]} (inner to outer), $motion frame $frame, shape $shape"
    "$target/release/examples/pose_garments" --config "$work/config.toml" --garments "$(IFS=,; echo "${garments[*]}")" \
        --motion "$motion" --frame "$frame" --shape="$shape" -o "$folder"
    local files=(--body "$folder/body.obj"
        --rest "${garments[@]/#/$folder/rest/}" --draped "${garments[@]/#/$folder/draped/}")
    local i
    for i in "${!files[@]}"; do
        case ${files[$i]} in "$folder"/rest/* | "$folder"/draped/*) files[$i]+=.obj ;; esac
    done
    "$target/release/clothcombo" score "${files[@]}" --json >"$folder/score.json"
    scripts/score_oracle.py "${files[@]}" --compare "$folder/score.json" || failed+=("$name")
}

check tank_top 01_01 800 0,0,0 Tank_Top_01
check dress Boxing_Toes 1500 1.5,-1,0.5 F_Dress_01
check tee 01_03 2000 -1.5,1 short_tail_camo_tee
check jeans Boxing_Toes 400 -1,0.5 Tightjeans
check skirt test_mocapbank 300 2,-2 miniskirt
check tunic 01_03 700 0.5,0.5 Asymmetric_Tunic_and_Sash
check layers Boxing_Toes 900 1,-0.5 ShortJeans Tank_Top_01 Coat

if [ ${#failed[@]} -gt 0 ]; then
    echo "FAILED: ${failed[*]}"
    exit 1
fi
echo "score and oracle agree on all outfits"
