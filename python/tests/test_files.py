"""What drapes write is read back by readers that are not ours."""
import struct

import numpy as np
import pytest

import clothcombo

pygltflib = pytest.importorskip("pygltflib")

FRAMES = 60


def accessor(document, blob, number):
    found = document.accessors[number]
    view = document.bufferViews[found.bufferView]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[found.type]
    kind = {pygltflib.FLOAT: "<f4", pygltflib.UNSIGNED_INT: "<u4"}[found.componentType]
    start = (view.byteOffset or 0) + (found.byteOffset or 0)
    values = np.frombuffer(blob, kind, found.count * width, start)
    return values.reshape(found.count, width) if width > 1 else values


@pytest.fixture(scope="module")
def shirt(meshes, tmp_path_factory):
    """A file whose faces left and right of the middle have textures of their own."""
    vertices, faces = meshes[0]
    path = tmp_path_factory.mktemp("files") / "shirt.obj"
    lines = ["v %.9f %.9f %.9f" % tuple(x) for x in vertices]
    sides = vertices[faces][:, :, 0].mean(1) > 0
    lines += ["vt %.6f %.6f" % (x + 0.5, y + side) for side in (0, 2) for x, y, _ in vertices]
    corner = lambda v, side: f"{v + 1}/{v + 1 + side * len(vertices)}"
    lines += ["f " + " ".join(corner(v, side) for v in face) for face, side in zip(faces, sides)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_motion_is_the_same_in_scene_and_point_caches(model, meshes, shirt, tmp_path):
    bends = np.zeros((FRAMES, 22, 3))
    bends[:, 16, 2] = np.linspace(0, -0.6, FRAMES)
    drape = model.drape([clothcombo.Garment(shirt), meshes[1]], motion=(bends, 30.0), resolve=False, refine=0)
    drape.save(tmp_path / "out")

    document = pygltflib.GLTF2().load(str(tmp_path / "out" / "scene.glb"))
    blob = document.binary_blob()
    assert [mesh.name for mesh in document.meshes] == ["body", *(garment.name for garment in drape.garments)]
    assert len(document.materials) == 3
    for mesh, garment in zip(document.meshes[1:], drape.garments):
        primitive = mesh.primitives[0]
        indices = accessor(document, blob, primitive.indices).reshape(-1, 3)
        base = accessor(document, blob, primitive.attributes.POSITION)
        moved = [base] + [base + accessor(document, blob, target["POSITION"]) for target in primitive.targets]
        assert len(moved) == FRAMES
        for frame, expected in zip(moved, garment.mesh_positions):
            assert np.abs(frame[indices] - expected[garment.mesh_faces]).max() < 1e-5
        assert np.allclose(np.linalg.norm(accessor(document, blob, primitive.attributes.NORMAL), axis=1), 1, atol=1e-5)
        if garment.name == "shirt":
            texture = accessor(document, blob, primitive.attributes.TEXCOORD_0)[indices]
            rest = meshes[0][0][garment.mesh_faces]
            side = 2 * (rest[:, :, 0].mean(1) > 0)[:, None]
            assert np.abs(texture[:, :, 0] - (rest[:, :, 0] + 0.5)).max() < 1e-5
            assert np.abs(texture[:, :, 1] - (1 - (rest[:, :, 1] + side))).max() < 1e-5
        else:
            assert primitive.attributes.TEXCOORD_0 is None
    times, weights = (accessor(document, blob, n) for n in (document.animations[0].samplers[0].input, document.animations[0].samplers[0].output))
    assert np.allclose(times, np.arange(FRAMES) / 30.0, atol=1e-5) and weights.size == FRAMES * (FRAMES - 1)

    for garment in drape.garments:
        data = (tmp_path / "out" / f"{garment.name}.pc2").read_bytes()
        magic, version, points, start, rate, samples = struct.unpack("<12siiffi", data[:32])
        assert (magic, version, points, samples) == (b"POINTCACHE2\0", 1, garment.positions.shape[1], FRAMES)
        cached = np.frombuffer(data, "<f4", offset=32).reshape(FRAMES, points, 3)
        assert np.abs(cached - garment.positions).max() < 1e-5
