from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple, Optional, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

Positions = NDArray[np.float64]
Faces = NDArray[np.uint32]
File = Union[str, PathLike[str]]
Mesh = Union[File, tuple[ArrayLike, ArrayLike]]
Pose = Union[File, ArrayLike]

__version__: str
TERMS: tuple[str, ...]

class Error(ValueError): ...
class FileError(Error, OSError): ...

class Body:
    name: str
    faces: Faces
    joint_names: list[str]
    parents: list[Optional[int]]
    shape_count: int
    @classmethod
    def load(cls, name: File = "mannequin") -> Body: ...
    def __call__(self, shape: ArrayLike = (), pose: Optional[Pose] = None) -> tuple[Positions, Positions]: ...
    def posed(self, shape: ArrayLike = (), pose: Optional[Pose] = None) -> tuple[Positions, Positions, Positions]: ...

class Garment:
    source: Mesh
    name: Optional[str]
    hints: dict[str, Any]
    def __init__(
        self,
        source: Mesh,
        name: Optional[str] = None,
        *,
        unit: Optional[str] = None,
        up: Optional[str] = None,
        arms: Optional[str] = None,
        legs: Optional[float] = None,
        category: Optional[str] = None,
        offset: Optional[Sequence[float]] = None,
        turn: Optional[float] = None,
        keep: Optional[str] = None,
        join_seams: Optional[str] = None,
        from_body: Optional[File] = None,
        material: Optional[dict[str, float]] = None,
    ) -> None: ...

class DrapedGarment:
    name: str
    held: bool
    category: str
    positions: Positions
    faces: Faces
    mesh_rest: Positions
    mesh_faces: Faces
    mesh_positions: Positions
    skinned: Positions
    network: Positions
    transforms: Positions

class Drape:
    garments: list[DrapedGarment]
    is_motion: bool
    seconds: list[float]
    body: Positions
    body_faces: Faces
    certificate: dict[str, Any]
    energies: dict[str, float]
    def score(self, frame: int = 0) -> dict[str, Any]: ...
    def report(self) -> dict[str, Any]: ...
    def save(self, folder: File, *, replace: bool = False, all_frames: bool = False) -> None: ...

class Model:
    garments: list[str]
    folder: Path
    body: Body
    @classmethod
    def load(
        cls,
        path: Optional[File] = None,
        *,
        body: Optional[File] = None,
        cache: Union[File, Literal[False], None] = None,
        folders: Iterable[File] = (),
    ) -> Model: ...
    def outfit(
        self,
        garments: Iterable[Union[Mesh, Garment]],
        *,
        order: Optional[Sequence[int]] = None,
        fit: Literal["auto", "always", "never"] = "auto",
    ) -> Outfit: ...
    def drape(
        self,
        garments: Iterable[Union[Mesh, Garment]],
        *,
        shape: ArrayLike = (),
        pose: Optional[Pose] = None,
        motion: Union[File, tuple[ArrayLike, float], None] = None,
        frames: tuple[int, Optional[int]] = (0, None),
        every: int = 1,
        posed: Optional[ArrayLike] = None,
        t_pose: Optional[ArrayLike] = None,
        order: Optional[Sequence[int]] = None,
        fit: Literal["auto", "always", "never"] = "auto",
        refine: Union[int, Literal["auto"], None] = None,
        resolve: bool = True,
        gap_mm: float = 1.0,
        time_limit: Optional[float] = None,
        smooth: Optional[int] = None,
    ) -> Drape: ...

class Outfit:
    names: list[str]
    def drape(
        self,
        *,
        shape: ArrayLike = (),
        pose: Optional[Pose] = None,
        motion: Union[File, tuple[ArrayLike, float], None] = None,
        frames: tuple[int, Optional[int]] = (0, None),
        every: int = 1,
        posed: Optional[ArrayLike] = None,
        t_pose: Optional[ArrayLike] = None,
        refine: Union[int, Literal["auto"], None] = None,
        resolve: bool = True,
        gap_mm: float = 1.0,
        time_limit: Optional[float] = None,
        smooth: Optional[int] = None,
    ) -> Drape: ...

class Resolved(NamedTuple):
    positions: list[Positions]
    certificate: dict[str, Any]

class Scene:
    vertex_counts: list[int]
    def __init__(
        self,
        garments: Iterable[Mesh],
        body: Mesh,
        *,
        losses: Optional[dict[str, Any]] = None,
        held: Optional[Sequence[bool]] = None,
        references: Optional[Sequence[Optional[ArrayLike]]] = None,
        transforms: Optional[ArrayLike] = None,
        layers: Optional[Sequence[tuple[int, int]]] = None,
        materials: Optional[Sequence[Optional[dict[str, float]]]] = None,
        dtype: Any = ...,
    ) -> None: ...
    def on_body(self, vertices: ArrayLike, transforms: Optional[ArrayLike] = None) -> Scene: ...
    @overload
    def __call__(
        self, positions: ArrayLike, canonical: None = None, *, sample: int = 0
    ) -> tuple[dict[str, float], NDArray[Any]]: ...
    @overload
    def __call__(
        self, positions: ArrayLike, canonical: ArrayLike, *, sample: int = 0
    ) -> tuple[dict[str, float], NDArray[Any], NDArray[Any]]: ...

def fit(garment: Union[Mesh, Garment], body: Body) -> tuple[Positions, Faces, dict[str, Any]]: ...
def check(paths: Union[File, Iterable[File]], *, body: Optional[File] = None) -> list[dict[str, Any]]: ...
def score(
    body: Mesh, rest: Iterable[Mesh], draped: Iterable[Mesh], *, canonical: Iterable[Mesh] = (), surface: bool = False
) -> dict[str, Any]: ...
def certificate(body: Mesh, garments: Iterable[Mesh], *, rest: Iterable[Mesh] = ()) -> dict[str, Any]: ...
def resolve(
    body: Mesh,
    garments: Iterable[Mesh],
    *,
    rest: Iterable[Mesh] = (),
    gap_mm: float = 1.0,
    time_limit: Optional[float] = None,
    keep_self: bool = False,
) -> Resolved: ...
def default_losses() -> dict[str, Any]: ...
