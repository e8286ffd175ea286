import gc
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import clothcombo
import numpy as np
import pytest
from conftest import NAMES, read_obj
from shapes import closed_tube, tube


def write_obj(path, mesh):
    lines = ["v %.9f %.9f %.9f" % tuple(x) for x in mesh[0]] + ["f %d %d %d" % tuple(f + 1) for f in np.asarray(mesh[1], int)]
    path.write_text("\n".join(lines) + "\n")


def test_three_garments_are_draped_as_by_the_program(model, meshes, program, tmp_path):
    given = [tmp_path / f"{name}.obj" for name in NAMES]
    for path, mesh in zip(given, meshes):
        write_obj(path, mesh)
    shape, pose = [0.8, -0.4], "walking"
    command = [program, "drape", "--no-cache", "--shape", "0.8,-0.4", "--pose", pose]
    subprocess.run([*command, "--garments", *map(str, given), "-o", str(tmp_path / "out")], check=True, capture_output=True)
    drape = model.drape(meshes, shape=shape, pose=pose)
    for name, garment, mesh in zip(NAMES, drape.garments, meshes):
        expected = np.array(read_obj(tmp_path / "out" / f"{name}.obj"))
        assert np.abs(garment.positions - expected).max() < 1e-6
        assert (garment.faces == mesh[1]).all()
    assert np.abs(drape.body - read_obj(tmp_path / "out" / "body.obj")).max() < 1e-6
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    counts = [{k: v for k, v in c.items() if "strain" not in k and k != "garments"} for c in (drape.certificate, report["certificate"])]
    assert counts[0] == counts[1]
    after = report["after"]["garments"]
    # The files hold 0.1 µm; the solver amplifies that a little.
    assert drape.energies["strain"] == pytest.approx(sum(g["raw"]["strain"] for g in after), rel=1e-5)


def test_garments_come_as_arrays_files_names_and_with_hints(model, meshes, tmp_path):
    shirt = tmp_path / "shirt.obj"
    write_obj(shirt, (100 * meshes[0][0], meshes[0][1]))
    quick = dict(pose="reaching", resolve=False)
    named = model.drape([NAMES[0]], **quick).garments[0]
    as_arrays = model.drape([meshes[0]], **quick).garments[0]
    in_cm = model.drape([clothcombo.Garment(shirt, unit="cm")], **quick).garments[0]
    assert (named.positions == as_arrays.positions).all()
    assert in_cm.name == "shirt" and np.abs(in_cm.positions - named.positions).max() < 0.02
    both = model.drape([meshes[0], clothcombo.Garment(meshes[1], name="my skirt")], order=[1, 0], **quick)
    assert [garment.name for garment in both.garments] == ["my_skirt", "garment_0"]
    assert both.garments[0].held and both.garments[0].category == "skirt"


@pytest.mark.parametrize("what, text", [
    ("nan", "vertex 7 has the non-finite position"),
    ("shape", "its shape is [N, 3]"),
    ("index", "face 3 uses vertex 99999"),
    ("negative", "an index of -1"),
    ("closed", "a closed surface without any opening"),
    ("empty", "the mesh has no face"),
    ("far", "garment_0: "),
])
def test_meshes_that_cannot_be_draped_are_refused_with_the_programs_text(model, meshes, what, text):
    x, f = meshes[0][0].copy(), meshes[0][1].astype(int)
    if what == "nan":
        x[7, 1] = np.nan
    elif what == "shape":
        x = x[:, :2]
    elif what == "index":
        f[3, 1] = 99999
    elif what == "negative":
        f[3, 1] = -1
    elif what == "closed":
        x, f = closed_tube(0.3, 0.7)
    elif what == "empty":
        f = f[:0]
    with pytest.raises(clothcombo.Error) as error:
        model.drape([(x + 100, f)] if what == "far" else [(x, f)], fit="never" if what == "far" else "auto")
    assert text in str(error.value) and isinstance(error.value, ValueError)


@pytest.mark.parametrize("arguments, text", [
    (dict(garments=[]), "0 garments; an outfit has 1 to 12"),
    (dict(garments=["nothing_000001"]), "no garment \"nothing_000001\""),
    (dict(shape=[np.nan]), "the shape holds a number that is not finite"),
    (dict(shape=[99.0]), "shape parameter 99"),
    (dict(shape=[0.0] * 999), "999 shape numbers"),
    (dict(pose="flying"), "neither a file nor the name of a pose"),
    (dict(pose=np.zeros((999, 3))), "999 joint rotations"),
    (dict(pose=[[np.inf, 0, 0]]), "not finite"),
    (dict(pose=np.full((22, 3), 90.0)), "radians"),
    (dict(motion=(np.zeros((4, 22, 3)), 0.0)), "a frame rate"),
    (dict(motion=(np.zeros((4, 22, 3)), 30), frames=(9, None)), "has 4 frames, no frame 9"),
    (dict(motion=np.zeros((4, 22, 3))), "motion"),
    (dict(posed=np.zeros((5, 3))), "5 vertices"),
    (dict(refine="fast"), "refine"),
    (dict(gap_mm=-1.0), "gap"),
    (dict(gap_mm=np.nan), "gap"),
    (dict(time_limit=-1.0), "time_limit"),
    (dict(fit="sometimes"), "auto, always or never"),
    (dict(order=[1, 1]), "order"),
    (dict(garments=[clothcombo.Garment(NAMES[0], size=3)]), "size"),
    (dict(garments=[clothcombo.Garment("shirt.obj", unit="ell")]), "unit: 'ell'"),
    (dict(garments=[clothcombo.Garment("shirt.obj", unit="cm")], fit="never"), "--fit never"),
])
def test_arguments_are_refused_with_the_programs_text(model, arguments, text):
    with pytest.raises(clothcombo.Error, match=None) as error:
        model.drape(**{"garments": [NAMES[0]], **arguments})
    assert text in str(error.value)


def test_files_that_are_not_there_are_an_os_error(model, tmp_path):
    for call in (
        lambda: model.drape([tmp_path / "none.obj"]),
        lambda: model.drape([NAMES[0]], motion=tmp_path / "none.npz"),
        lambda: clothcombo.Model.load(tmp_path / "none"),
        lambda: clothcombo.Body.load(tmp_path / "none.npz"),
        lambda: clothcombo.score(tmp_path / "none.obj", [], []),
    ):
        with pytest.raises(OSError) as error:
            call()
        assert "none" in str(error.value) and isinstance(error.value, clothcombo.Error)


def test_a_motion_and_a_posed_surface_are_draped_and_saved(model, tmp_path):
    poses = np.zeros((3, 22, 3))
    poses[:, 16, 2] = [-0.3, -0.4, -0.5]
    drape = model.drape([NAMES[1]], motion=(poses, 30.0), resolve=False)
    assert drape.body.shape == (3, *model.body((), None)[0].shape) and drape.seconds == pytest.approx([0, 1 / 30, 2 / 30])
    assert drape.garments[0].positions.shape[0] == 3
    drape.save(tmp_path / "out")
    assert (tmp_path / "out" / "scene.glb").stat().st_size > 10_000 and (tmp_path / "out" / "report.json").is_file()
    with pytest.raises(clothcombo.Error, match="is there and is not empty"):
        drape.save(tmp_path / "out")
    with pytest.warns(UserWarning, match="shape parameter"):
        one = model.drape([NAMES[1]], pose=poses[1], shape=[4.0], resolve=False, refine=0)
    vertices, joints = model.body([4.0], poses[1])
    assert np.abs(one.body - vertices).max() < 1e-6 and len(joints) == len(model.body.joint_names)
    again = model.drape([NAMES[1]], posed=vertices, t_pose=model.body([4.0])[0], resolve=False, refine=0)
    assert np.abs(again.garments[0].positions - one.garments[0].positions).max() < 5e-3


def resident_mb():
    fields = Path("/proc/self/status").read_text().split()
    return int(fields[fields.index("VmRSS:") + 1]) / 1024


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_drapes_leak_nothing(model, meshes):
    outfit = model.outfit([meshes[1]])

    def drapes(count):
        for i in range(count):
            outfit.drape(shape=[0.001 * i], resolve=False).garments[0].positions
        gc.collect()
        return resident_mb()

    count = int(os.environ.get("CLOTHCOMBO_DRAPES", "30"))
    before = drapes(count // 2)
    after = drapes(count)
    print(f"{count} drapes: {before:.1f} to {after:.1f} MB")
    assert after - before < 10


def test_other_threads_run_during_a_drape(model):
    ticks, over = [], threading.Event()

    def tick():
        while not over.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-3)

    other = threading.Thread(target=tick)
    other.start()
    start = time.perf_counter()
    model.drape([NAMES[0]], pose="walking")
    seconds = time.perf_counter() - start
    over.set()
    other.join()
    assert len([t for t in ticks if start < t < start + seconds]) > 20 * seconds


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_forked_process_is_told_and_does_not_hang(model):
    code = """if True:
        import os, clothcombo
        body = clothcombo.Body.load()
        child = os.fork()
        if child == 0:
            try:
                body([1.0])
            except RuntimeError as error:
                os._exit(0 if "spawn" in str(error) else 2)
            os._exit(1)
        raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    """
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", code], timeout=60).returncode == 0
