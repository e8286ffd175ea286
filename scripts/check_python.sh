#!/usr/bin/env bash
# Builds the Python wheel, installs it into a fresh virtual environment, and runs python/tests against it; those with PyTorch
# where it is found. About two minutes after `cargo build --release --workspace`, whose target directory is used.
#
#   scripts/check_python.sh [FOLDER]     FOLDER keeps the wheel
#
# PYTHON names the interpreter (3.9 or later, with venv; default python3); SITE a folder of packages that may be used beside
# those of the environment, for example one with torch.
set -euo pipefail
case ${1:-} in -*) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;; esac
wheels=${1:+$(mkdir -p "$1" && realpath "$1")}
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
wheels=${wheels:-$work/wheels}

pip() { "$work/$1/bin/python" -m pip install --quiet --disable-pip-version-check "${@:2}"; }

"${PYTHON:-python3}" -m venv "$work/build"
pip build 'maturin>=1.9.4,<2'
"$work/build/bin/maturin" build --release --quiet --manifest-path python/Cargo.toml --interpreter "$work/build/bin/python" \
    --out "$wheels"
wheel=$(ls -t "$wheels"/clothcombo-*.whl | head -n 1)
bytes=$(wc -c <"$wheel")
echo "$(basename "$wheel"): $((bytes / 1000)) kB"
[ "$bytes" -le 25000000 ] || { echo "the wheel is larger than 25 MB" >&2; exit 1; }

"${PYTHON:-python3}" -m venv "$work/test"
pip test "$wheel" pytest pygltflib
[ -z "${SITE:-}" ] || echo "$SITE" >"$(echo "$work"/test/lib/python*/site-packages)/site.pth"
program=$(realpath "${CARGO_TARGET_DIR:-target}")/release/clothcombo
cd python/tests
CLOTHCOMBO=$program "$work/test/bin/python" -m pytest -q -p no:cacheprovider --durations 5
