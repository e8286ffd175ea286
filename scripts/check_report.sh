#!/usr/bin/env bash
# Opens the report of a run in a real browser without network, takes a picture of it, and compares what the browser laid out
# with the logs: every figure visible, with a curve, and the sample pictures decoded.
#
#   scripts/check_report.sh RUN [PICTURE]      default: RUN/report.png
#
# Needs chromium (Debian: apt install chromium).
set -euo pipefail
run=$(realpath "$1")
picture=$(realpath -m "${2:-$run/report.png}")
browser=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || {
    echo "no chromium found" >&2
    exit 1
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# The page itself has no script: what it looks like is measured by one that is added to a copy.
python3 - "$run/report.html" "$work/measured.html" <<'PYTHON'
import pathlib, sys
html = pathlib.Path(sys.argv[1]).read_text()
script = """<script>addEventListener('load', () => {
  const lines = [];
  for (const figure of document.querySelectorAll('figure')) {
    const box = figure.getBoundingClientRect(), curve = figure.querySelector('.curve, .part0'), image = figure.querySelector('img');
    const drawn = image ? image.naturalWidth : curve ? Math.round(curve.getBoundingClientRect().width) : 0;
    lines.push([figure.id || 'sample', Math.round(box.width), Math.round(box.height), drawn].join(' '));
  }
  lines.push('page ' + document.body.scrollWidth + ' ' + document.documentElement.clientWidth + ' ' + document.body.scrollHeight);
  const out = document.createElement('pre'); out.id = 'measured'; out.textContent = lines.join('\\n'); document.body.append(out);
})</script></body>"""
pathlib.Path(sys.argv[2]).write_text(html.replace("</body>", script))
PYTHON
chromium() {
    "$browser" --headless --no-sandbox --disable-gpu --hide-scrollbars --host-resolver-rules="MAP * ~NOTFOUND" \
        --user-data-dir="$work/profile" "$@" 2>/dev/null
}
chromium --window-size=1280,1000 --virtual-time-budget=5000 --dump-dom "file://$work/measured.html" >"$work/dom.html"
python3 - "$work/dom.html" <<'PYTHON'
import re, sys
dom = open(sys.argv[1], encoding="utf-8").read()
measured = re.search(r'<pre id="measured">(.*?)</pre>', dom, re.S).group(1).split("\n")
figures = [line.split(" ") for line in measured if not line.startswith("page")]
names = [f[0] for f in figures]
for wanted in "loss grad_norm strain bending gravity body_collision repulsion holding layer_collision layer_distance lr time".split():
    assert f"chart-{wanted}" in names, f"no figure of {wanted}"
for name, width, height, drawn in figures:
    assert int(width) > 300 and int(height) > 100, f"{name} is {width} x {height}"
    assert int(drawn) > 0, f"{name} shows nothing"
assert "sample" in names, "no sample picture"
inner, outer, height = map(int, measured[-1].split(" ")[1:])
assert inner <= outer, f"the page is {inner} wide in a window of {outer}"
print(f"{len(figures)} figures laid out, all with something in them; the page is {height} pixels high")
open(sys.argv[1] + ".height", "w").write(str(height))
PYTHON
height=$(cat "$work/dom.html.height")
chromium --window-size="1280,$((height < 12000 ? height : 12000))" --screenshot="$picture" "file://$run/report.html" >/dev/null
echo "picture $picture"
