from collections.abc import Sequence
from typing import Union

import torch

from . import Scene

TERMS: tuple[str, ...]

class PhysicsLoss(torch.nn.Module):
    scenes: list[Scene]
    def __init__(self, scenes: Union[Scene, Sequence[Scene]]) -> None: ...
    def forward(
        self,
        positions: Union[torch.Tensor, Sequence[torch.Tensor]],
        canonical: Union[torch.Tensor, Sequence[torch.Tensor], None] = None,
        sample: int = 0,
    ) -> tuple[torch.Tensor, torch.Tensor]: ...
