#!/usr/bin/env python3
"""Puts the tables and figures of a report of `clothcombo eval` into docs/results.md and docs/figures.

What is written by hand stays: everything before the first table, and everything from "## Smoke training" on.

    clothcombo eval -o report && scripts/results_page.py report        # needs Pillow
"""

import pathlib
import re
import sys
import textwrap

from PIL import Image

FIRST, LAST = "### Sets\n", "## Smoke training\n"
WIDTH = 131
DOCS = pathlib.Path(__file__).resolve().parent.parent / "docs"


def body(report: str) -> str:
    """The report's sections, one level deeper."""
    sections = report[report.index(FIRST[1:]) :]
    deeper = re.sub(r"^(#+) ", r"#\1 ", sections, flags=re.MULTILINE)
    return "\n".join(wrapped(line) for line in deeper.split("\n"))


def wrapped(line: str) -> str:
    """A paragraph in lines as long as those of the page; tables, headings and figures as they are."""
    return line if re.match(r"[|#!*]|$", line) else textwrap.fill(line, WIDTH, break_long_words=False)


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    new = body((folder / "eval.md").read_text())
    page = DOCS / "results.md"
    old = page.read_text()
    # Colours of a drawing are few: a palette makes the files four times smaller.
    for name in set(re.findall(r"\]\(([\w-]+\.png)\)", new)):
        picture = Image.open(folder / name).convert("RGB")
        picture.quantize(256, kmeans=3).save(DOCS / "figures" / name, optimize=True)
    new = re.sub(r"\]\(([\w-]+\.png)\)", r"](figures/\1)", new)
    page.write_text(old[: old.index(FIRST)] + new.rstrip("\n") + "\n\n" + old[old.index(LAST) :])


if __name__ == "__main__":
    main()
