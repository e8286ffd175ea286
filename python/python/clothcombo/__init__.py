"""Learned draping of multi-layered clothing.

The same library as the programs `clothcombo` and `clothcombo-train`, with their defaults and messages, on numpy arrays. Positions
are in metres, y up; garments come innermost first; vertices, faces and frames are counted from 0. What the programs log as a
warning is a `UserWarning`.

    model = clothcombo.Model.load()
    drape = model.drape([(shirt_positions, shirt_faces), "coat.obj"], shape=[1.0], pose="walking")
    drape.garments[0].positions, drape.certificate
"""

from . import _native
from ._body import Body
from ._drape import Drape, DrapedGarment, Garment, Model, Outfit, fit
from ._errors import Error, FileError
from ._measure import Resolved, certificate, check, resolve, score
from ._scene import TERMS, Scene, default_losses

__version__ = _native.__version__
__all__ = [
    "Body", "Drape", "DrapedGarment", "Error", "FileError", "Garment", "Model", "Outfit", "Resolved", "Scene", "TERMS",
    "certificate", "check", "default_losses", "fit", "resolve", "score",
]
