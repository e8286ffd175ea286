import threading

import clothcombo
import numpy as np
import pytest
from shapes import closed_tube, tube

ALL = {"repulsion": {"weight": 0.001, "subset": 0}}


def meshes():
    body = closed_tube(0.1, 1.0, 24, 20)
    return body, [tube(r, 0.6, 20, 14) for r in (0.11, 0.12)]


def scene(losses=ALL, **more):
    body, garments = meshes()
    return clothcombo.Scene(garments, body, losses=losses, held=[True, False], **more)


def state(dtype=np.float64):
    """Positions where every one of the eight terms acts, and canonical ones."""
    random = np.random.default_rng(3)
    rest = np.vstack([garment[0] for garment in meshes()[1]])
    count = len(rest) // 2
    posed = rest + random.normal(0, 0.004, rest.shape)
    posed[count:, [0, 2]] *= 0.92
    posed[:count, [0, 2]] *= 0.95
    return posed.astype(dtype), (rest + random.normal(0, 0.01, rest.shape)).astype(dtype)


def test_gradients_are_those_of_finite_differences_term_by_term():
    posed, canonical = state()
    for term in clothcombo.TERMS:
        losses = {name: {"weight": 0.0} for name in clothcombo.TERMS}
        losses["repulsion"]["subset"] = 0
        losses[term]["weight"] = 1.0
        one = scene({"reference_vertices": 0.0, **losses}, dtype=np.float64)
        energies, gradient, of_canonical = one(posed, canonical)
        assert energies["total"] == energies[term] and energies[term] != 0
        assert all(np.isnan(energies[other]) for other in clothcombo.TERMS if other != term)
        direction = np.random.default_rng(1).normal(size=posed.shape)
        h = 1e-7
        ahead, behind = (one(posed + s * h * direction, canonical + s * h * direction)[0][term] for s in (1, -1))
        expected = ((gradient + of_canonical) * direction).sum()
        assert (ahead - behind) / (2 * h) == pytest.approx(expected, rel=2e-5), term


def test_single_precision_batches_bodies_and_samples():
    posed, canonical = state()
    double, single = scene(), scene(dtype=np.float32)
    energies, gradient, _ = double(posed, canonical)
    narrow, of_narrow, _ = single(*state(np.float32))
    assert narrow == pytest.approx(energies, rel=1e-3) and of_narrow.dtype == np.float32
    assert np.abs(of_narrow - gradient).max() < 1e-3 * np.abs(gradient).max()
    body = meshes()[0][0]
    moved = double.on_body(body + [0.01, 0, 0])
    assert moved(posed, canonical)[0]["body_collision"] != energies["body_collision"]
    assert moved(posed + [0.01, 0, 0], canonical)[0] == pytest.approx(energies, rel=1e-9)
    from clothcombo._scene import evaluate

    both = evaluate([double, moved], [posed, posed], [canonical, canonical])
    assert both[0][0] == energies["total"] and both[1][0] == moved(posed, canonical)[0]["total"]
    sampled = scene({"repulsion": {"subset": 4}})
    first, second = (sampled(posed, canonical, sample=i)[0]["repulsion"] for i in (0, 1))
    assert first != second and sampled(posed, canonical)[0]["repulsion"] == first


def test_held_garments_are_read_where_they_are_posed():
    posed, _ = state()
    still = np.broadcast_to(np.eye(3, 4), (len(posed), 3, 4))
    held = scene(transforms=still)
    energies, gradient = held(posed)
    assert energies["holding"] > 0
    assert held.on_body(meshes()[0][0], still)(posed)[0] == energies
    with pytest.raises(clothcombo.Error, match="transforms"):
        held.on_body(meshes()[0][0])


def test_what_cannot_be_evaluated_is_refused():
    posed, canonical = state()
    body, garments = meshes()
    one = scene()
    bad = posed.copy()
    bad[5, 2] = np.nan
    make = clothcombo.Scene
    flat = (garments[0][0] * 0, garments[0][1])
    for wrong, text in [
        (lambda: one(bad, canonical), "vertex 5"),
        (lambda: one(posed * 1e30, canonical), "within a kilometre"),
        (lambda: one(posed[1:], canonical), "559 positions for the 560 vertices"),
        (lambda: one(posed), "held garments need them"),
        (lambda: one(posed[:, :2], canonical), "shape"),
        (lambda: one(posed.astype(np.float16), canonical), "float16"),
        (lambda: one(posed.astype(int), canonical), "int64"),
        (lambda: one(posed, canonical, sample=-1), "sample"),
        (lambda: one.on_body(body[0][1:]), "positions for a mesh"),
        (lambda: make([], body), "at least one garment"),
        (lambda: make([flat], body), "no area"),
        (lambda: make(garments, body, held=[True]), "held"),
        (lambda: make(garments, body, layers=[(1, 0)]), "layer pair 0"),
        (lambda: make(garments, body, layers=[(0, 7)]), "layer pair 0"),
        (lambda: make(garments, body, transforms=np.zeros((3, 3, 4))), "transforms"),
        (lambda: make(garments, body, losses={"strain": {"wait": 1}}), "unknown field `wait`"),
        (lambda: make(garments, body, losses={"strain": {"weight": -1}}), "losses.strain.weight"),
        (lambda: make(garments, body, losses={"material": {"thickness": 0}}), "thickness"),
        (lambda: make(garments, (body[0] * 1000, body[1])), "no human body in metres"),
        (lambda: make(garments, (body[0], body[1] + 99999)), "uses vertex"),
    ]:
        with pytest.raises(clothcombo.Error, match=text):
            wrong()


def test_threads_may_share_a_scene():
    one, (posed, canonical) = scene(), state()
    expected = one(posed, canonical)
    results = []
    threads = [threading.Thread(target=lambda: results.append(one(posed, canonical))) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(results) == 4 and all((found[1] == expected[1]).all() for found in results)


def test_a_garment_may_be_of_another_material():
    posed, canonical = state()
    usual, _, _ = scene()(posed, canonical)
    same, _, _ = scene(materials=[None, {}])(posed, canonical)
    assert same == usual
    heavy, _, _ = scene(materials=[None, {"density": 4260.0}])(posed, canonical)
    both, _, _ = scene({**ALL, "material": {"density": 4260.0}})(posed, canonical)
    assert usual["gravity"] != heavy["gravity"] != both["gravity"]
    assert heavy["strain"] == usual["strain"]
    thick, _, _ = scene(materials=[{"thickness": 0.016}, None])(posed, canonical)
    assert thick["body_collision"] > usual["body_collision"] and thick["layer_collision"] > usual["layer_collision"]
    with pytest.raises(clothcombo.Error, match="garment 1: energy setting `material.density`"):
        scene(materials=[None, {"density": -1.0}])
    with pytest.raises(clothcombo.Error, match="3 materials for 2 garments"):
        scene(materials=[None] * 3)
    with pytest.raises(clothcombo.Error, match="unknown field `weight`"):
        scene(materials=[{"weight": 1.0}, None])
