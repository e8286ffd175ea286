#!/usr/bin/env python3
"""Makes every picture of docs/figures anew, with the shipped model, and prints its path.

    cargo build --release --workspace --bins && scripts/open_data.sh
    scripts/figures.py                    # about ten minutes on two cores; needs Pillow
    scripts/figures.py --report report    # takes what `clothcombo eval -o report` drew: numbers of docs/results.md and figures agree
    scripts/figures.py --only motion wardrobe

Speed against error is timed: nothing else should run meanwhile.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile
import time

from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/clothcombo"
DATA = ROOT / "datasets/open"
GALLERY = ["orders", "shapes", "poses", "layers", "outer"]
ALL = [*GALLERY, "pareto", "motion", "wardrobe"]
# The dance of docs/resolve.md, and how its picture is laid out (pixels): trainer/src/picture/{outfits,sheet}.rs.
DANCE = DATA / "motions/humanoid3d_dance_a.npz"
OUTFIT = ["helper_tee", "helper_skirt_knee", "helper_open_shirt_short"]
CELL, GAP, LINE, PAPER = (340, 540), 8, 30, (250, 250, 249)
FRAMES, VIEW, PANEL_HEIGHT = 4, 2, 437


def clothcombo(*arguments) -> None:
    command = [str(argument) for argument in (PROGRAM, *arguments)]
    print("$", *command, file=sys.stderr, flush=True)
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)


def small_palette(picture: Image.Image) -> Image.Image:
    """The picture in 256 colours, the file of which is four times smaller.

    A colour counts by the root of its pixels: else the background takes most of the palette, and a strip of cloth is mottled.
    """
    pixels = [colour for count, colour in picture.getcolors(picture.width * picture.height) for _ in range(round(count**0.5))]
    sample = Image.new("RGB", (len(pixels), 1))
    sample.putdata(pixels)
    return picture.quantize(palette=sample.quantize(256, kmeans=3), dither=Image.Dither.NONE)


def save(picture: Image.Image, name: str, folder: pathlib.Path) -> None:
    path = folder / f"{name}.png"
    small_palette(picture.convert("RGB")).save(path, optimize=True)
    print(f"{path}  {path.stat().st_size // 1024} KiB", flush=True)


def panels(sheet: Image.Image) -> Image.Image:
    """One view of every frame of a motion's picture, side by side."""
    cells = []
    for frame in range(FRAMES):
        top = sheet.height - (FRAMES - frame) * (CELL[1] + GAP) - (FRAMES - 1 - frame) * LINE
        left = GAP + VIEW * (CELL[0] + GAP)
        if sheet.getpixel((left - 1, top)) != PAPER or sheet.getpixel((left, top)) == PAPER:
            sys.exit("the picture of a motion is laid out otherwise than scripts/figures.py believes")
        cell = sheet.crop((left, top, left + CELL[0], top + CELL[1]))
        cells.append(cell.resize((CELL[0] * PANEL_HEIGHT // CELL[1], PANEL_HEIGHT), Image.Resampling.LANCZOS))
    row = Image.new("RGB", (sum(c.width + GAP for c in cells) - GAP, PANEL_HEIGHT), PAPER)
    for i, cell in enumerate(cells):
        row.paste(cell, (i * (cell.width + GAP), 0))
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=ALL, default=ALL, metavar="FIGURE", help=", ".join(ALL))
    parser.add_argument("--report", type=pathlib.Path, help="report of `clothcombo eval`; default: it is made, pictures only")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/figures", help="default: docs/figures")
    arguments = parser.parse_args()
    for needed, remedy in [(PROGRAM, "cargo build --release --workspace --bins"), (DATA / "body.npz", "scripts/open_data.sh")]:
        if not needed.exists():
            sys.exit(f"figures: {needed} is missing: run {remedy}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    start, wanted = time.monotonic(), set(arguments.only)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        if wanted & {*GALLERY, "pareto"}:
            report = arguments.report
            if report is None:
                report = scratch / "report"
                parts = ["gallery"] * bool(wanted & set(GALLERY)) + ["pareto"] * ("pareto" in wanted)
                clothcombo("eval", "--only", ",".join(parts), "-o", report)
            for name in [name for name in [*GALLERY, "pareto"] if name in wanted]:
                save(Image.open(report / f"{name}.png"), name, arguments.out)
        if "motion" in wanted:
            clothcombo("drape", "--dataset", DATA, "--garments", *OUTFIT, "--motion", DANCE, "--frames", "0..61", "-o", scratch / "dance")
            save(panels(Image.open(scratch / "dance/picture.png").convert("RGB")), "motion", arguments.out)
        if "wardrobe" in wanted:
            picture = scratch / "wardrobe.png"
            clothcombo("generate", "--count", 48, "--seed", 7, "--body", DATA / "body.npz", "--picture", picture, "-o", scratch / "made")
            save(Image.open(picture), "wardrobe", arguments.out)
    print(f"{len(wanted)} pictures in {time.monotonic() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
