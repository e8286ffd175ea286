#!/usr/bin/env python3
"""Copies the numbers of a report of `clothcombo eval` into docs/results.md.

A comment `<!-- eval: TITLE -->` stands above every table that the report fills. The page chooses the rows by their first cell, COLUMNS
chooses the columns; the rest of the page is written by hand. A table that the report lacks (ablations, for example) stays as it is.

    clothcombo eval -o report && scripts/results_page.py report
    scripts/figures.py --report report          # its pictures
    scripts/results_page.py --check report      # any report: whether its tables have these columns
"""

import pathlib
import re
import sys

DOCS = pathlib.Path(__file__).resolve().parent.parent / "docs"
MARKER = re.compile(r"<!-- eval: (.+) -->")
# Per table, how the headings of the columns begin that the page shows after the first.
COLUMNS = {
    "The networks on every set": ["strain over", "of medians", "collision over it (as", "collision over it (paper", "deeper"],
    "Training garments, held-out windows: energies [J], means": [
        "total", "strain", "bending", "collision (as", "collision (paper",
    ],
    "Training garments, held-out windows: energies [J] with correct and wrong embeddings": [
        "correct", "different", "zero", "paper: correct", "paper: different", "paper: zero",
    ],
    "Strain of each layer": ["1", "2", "3", "4", "5", "6"],
    "Order and contact of the layers": [
        "strain of a single garment", "in the outfit", "untangled", "pairs between", "layer-order violations then",
        "intersection-free then",
    ],
    "Ablations": ["strain", "layer collision", "layer-order violations"],
    "Time per garment": ["embedding", "single draping", "untangling", "acceptance", "post-process"],
    "Speed against error, one garment": ["time", "excess energy", "distance", "strain", "pairs with"],
    "Speed against error, 3 garments": ["time", "excess energy", "distance", "strain", "pairs with", "pairs between"],
}
# Tables of which the page shows one number per cell, without the interval or median in brackets.
PLAIN = {
    "Training garments, held-out windows: energies [J], means",
    "Training garments, held-out windows: energies [J] with correct and wrong embeddings",
    "Order and contact of the layers",
    "Ablations",
    "Speed against error, one garment",
    "Speed against error, 3 garments",
}

# Tables that a report lacks where there are no clips, and no ablated models.
OPTIONAL = {title for title in COLUMNS if title.startswith("Training garments, held-out windows")} | {"Ablations"}


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def shown(cell: str, title: str) -> str:
    return re.sub(r" [\[(].*", "", cell) if title in PLAIN else cell


def column(heading: list[str], start: str, title: str) -> int:
    found = [i for i, name in enumerate(heading) if i > 0 and name.startswith(start)]
    return found[0] if found else sys.exit(f"no column of {title!r} in the report begins with {start!r}")


def report_rows(report: str, title: str) -> dict[str, list[str]] | None:
    """Per first cell the chosen cells of the report's table; None without such a table."""
    at = report.find(f"\n**{title}")
    if at < 0:
        return None
    table = re.search(r"(?:^\|.*\n)+", report[at:], re.MULTILINE)[0].splitlines()
    heading = cells(table[0])
    chosen = [column(heading, start, title) for start in COLUMNS[title]]
    rows = (cells(line) for line in table[2:])
    return {row[0]: [shown(row[i], title) for i in chosen] for row in rows}


def refreshed(page: str, report: str) -> str:
    """The page with the report's numbers in its marked tables."""
    lines = page.split("\n")
    for at, line in enumerate(lines):
        marker = MARKER.fullmatch(line)
        if not marker:
            continue
        rows = report_rows(report, marker[1])
        if rows is None:
            print(f"kept, not in the report: {marker[1]}", file=sys.stderr)
            continue
        row = at + 3
        while lines[row].startswith("|"):
            name = cells(lines[row])[0]
            if name not in rows:
                sys.exit(f"no row of {marker[1]!r} in the report is {name!r}")
            lines[row] = "| " + " | ".join([name, *rows[name]]) + " |"
            row += 1
    return "\n".join(lines)


def main() -> None:
    if sys.argv[1:2] == ["--check"] and len(sys.argv) == 3:
        report = (pathlib.Path(sys.argv[2]) / "eval.md").read_text()
        missing = [title for title in COLUMNS if title not in OPTIONAL and not report_rows(report, title)]
        sys.exit(f"tables that the report lacks: {missing}" if missing else None)
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    page = DOCS / "results.md"
    page.write_text(refreshed(page.read_text(), (folder / "eval.md").read_text()))


if __name__ == "__main__":
    main()
