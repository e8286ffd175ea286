import os
from pathlib import Path

import pytest

import clothcombo

NAMES = ["t_shirt_000003", "skirt_000005", "open_shirt_000004"]


@pytest.fixture(scope="session")
def model(tmp_path_factory):
    return clothcombo.Model.load(cache=tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def meshes(model):
    """Three garments at rest on the body, as arrays, innermost first."""
    drape = model.drape(NAMES, resolve=False)
    return [(garment.mesh_rest, garment.mesh_faces) for garment in drape.garments]


@pytest.fixture(scope="session")
def program():
    """The program that this package is compared with."""
    path = os.environ.get("CLOTHCOMBO", "")
    if not Path(path).is_file():
        pytest.skip("CLOTHCOMBO does not name the program clothcombo")
    return path


def read_obj(path):
    lines = [line.split() for line in Path(path).read_text().splitlines()]
    return [[float(x) for x in line[1:4]] for line in lines if line[:1] == ["v"]]
