import json
import subprocess
from pathlib import Path

import clothcombo
import numpy as np
import pytest
from shapes import closed_tube, tube
from test_drape import write_obj

# The body of the model that the package carries.
BODY = Path(__file__).parents[2] / "models/default/body.npz"


@pytest.fixture
def scene():
    body = closed_tube(0.1, 1.0, 24, 20)
    inner, outer = (tube(r, 0.6, 20, 14) for r in (0.11, 0.12))
    return body, [inner, outer]


def test_a_score_is_the_programs_of_files_and_arrays(scene, program, tmp_path):
    body, garments = scene
    draped = [(x * [1.0, 1.02, 1.0], f) for x, f in garments]
    paths = {name: tmp_path / f"{name}.obj" for name in ("body", "r0", "r1", "d0", "d1")}
    for path, mesh in zip(paths.values(), [body, *garments, *draped]):
        write_obj(path, mesh)
    files = {name: str(path) for name, path in paths.items()}
    command = [program, "score", "--body", files["body"], "--rest", files["r0"], files["r1"]]
    command += ["--draped", files["d0"], files["d1"], "--json"]
    expected = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    found = clothcombo.score(files["body"], [files["r0"], files["r1"]], [files["d0"], files["d1"]])
    assert found == expected
    of_arrays = clothcombo.score(body, garments, draped)
    raw = [score["garments"][1]["raw"] for score in (of_arrays, expected)]
    assert raw[0] == pytest.approx(raw[1], rel=1e-4)
    with_holding = clothcombo.score(body, garments, draped, canonical=garments, surface=True)
    assert "holding" in with_holding["garments"][0]["raw"]


def test_what_intersects_is_counted_and_resolved(scene):
    body, [inner, outer] = scene
    sunk = (outer[0] * [0.88, 1.0, 0.88], outer[1])
    before = clothcombo.certificate(body, [inner, sunk], rest=[inner, outer])
    assert before["order_violations"] > 0.5
    found = clothcombo.resolve(body, [inner, sunk], rest=[inner, outer])
    count = lambda c: c["body_triangle_pairs"] + c["layer_triangle_pairs"] + c["self_triangle_pairs"]
    assert count(found.certificate) == 0 and found.certificate["order_violations"] == 0
    assert [p.shape for p in found.positions] == [inner[0].shape, outer[0].shape]
    for wrong, text in [
        (lambda: clothcombo.resolve(body, [inner], gap_mm=1e9), "gap"),
        (lambda: clothcombo.certificate((body[0] * 1000, body[1]), [inner]), "no human body in metres"),
        (lambda: clothcombo.certificate(body, [(inner[0] + 9, inner[1])]), "beside the body"),
        (lambda: clothcombo.score(body, [inner], [outer, inner]), "1 rest meshes"),
        (lambda: clothcombo.score(body, [inner], [(inner[0][1:], inner[1] % (len(inner[0]) - 1))]), "vertices"),
    ]:
        with pytest.raises(clothcombo.Error, match=text):
            wrong()


def test_files_are_checked_and_garments_fitted(model, meshes, tmp_path):
    write_obj(tmp_path / "shirt.obj", (100 * meshes[0][0], meshes[0][1]))
    write_obj(tmp_path / "shirt_in_metres.obj", meshes[0])
    (tmp_path / "broken.obj").write_text("v 0 0\n")
    found = {file["path"].split("/")[-1]: file for file in clothcombo.check(tmp_path, body=BODY)}
    assert "unusable" not in found["shirt_in_metres.obj"] and found["shirt_in_metres.obj"]["garment"]["category"] == "t_shirt"
    assert "unusable" in found["broken.obj"]
    x, f, report = clothcombo.fit(tmp_path / "shirt.obj", model.body)
    assert np.abs(x - meshes[0][0]).max() < 0.02 and f.shape == meshes[0][1].shape and report["placement"]["unit"] == "cm"
    with pytest.raises(clothcombo.Error, match="on body"):
        clothcombo.fit(closed_tube(0.3, 0.7), model.body)
