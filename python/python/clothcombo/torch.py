"""The physical losses for PyTorch; `import clothcombo.torch` needs torch, the rest of the package does not."""

import torch

from ._errors import Error
from ._scene import TERMS, evaluate


class _Energies(torch.autograd.Function):
    """Weighted sums [B] and terms [B, 8] of B scenes; inputs are B posed, then B canonical tensors or None."""

    @staticmethod
    def forward(ctx, scenes, sample, *tensors):
        count = len(scenes)
        arrays = [None if x is None else x.detach().cpu().numpy() for x in tensors]
        values = evaluate(scenes, arrays[:count], arrays[count:], sample)
        like = tensors[0]
        to = lambda x: torch.from_numpy(x).to(like.device)
        gradients = [to(value[2]) for value in values] + [None if v[3] is None else to(v[3]) for v in values]
        ctx.save_for_backward(*tensors, *gradients)
        totals = torch.tensor([value[0] for value in values], dtype=like.dtype, device=like.device)
        terms = torch.stack([torch.from_numpy(value[1]) for value in values]).to(like.device, like.dtype)
        ctx.mark_non_differentiable(terms)
        return totals, terms

    @staticmethod
    def backward(ctx, of_totals, _):
        count = len(of_totals)
        saved = ctx.saved_tensors
        inputs, gradients = saved[: 2 * count], saved[2 * count :]
        scaled = lambda i: of_totals[i % count] * _Gradient.apply(gradients[i], inputs[i])
        return (None, None, *(scaled(i) if ctx.needs_input_grad[2 + i] else None for i in range(2 * count)))


class _Gradient(torch.autograd.Function):
    """A gradient at some positions. It depends on them, so that a second derivative is refused instead of left out."""

    @staticmethod
    def forward(ctx, gradient, positions):
        return gradient.view_as(gradient)

    @staticmethod
    def backward(ctx, _):
        raise Error("the physical losses can be differentiated once: they have no second derivative")


class PhysicsLoss(torch.nn.Module):
    """The weighted sum of the eight physical losses of a scene, or of a list of scenes.

        loss, terms = PhysicsLoss(scene)(positions)
        loss.backward()

    `positions` [ΣV, 3] (m), garment after garment; of B scenes a list of B tensors or one tensor [B, ΣV, 3]. Returns the sum, a
    scalar or [B], which carries the gradient (once: it has no second derivative), and the eight terms in the order of
    `clothcombo.TERMS`, [8] or [B, 8], detached and unweighted. Scenes are evaluated in parallel on the CPU, in the precision of
    the tensors, float32 or float64: CPU tensors are read in place, tensors of a GPU are copied there and back. `canonical`
    positions (before skinning) are for garments held by them. `sample` numbers the random pairs of the repulsion: count steps.
    """

    def __init__(self, scenes):
        super().__init__()
        self.is_batch = isinstance(scenes, (list, tuple))
        self.scenes = list(scenes) if self.is_batch else [scenes]
        if not self.scenes:
            raise Error("a loss of no scene")

    def forward(self, positions, canonical=None, sample=0):
        count = len(self.scenes)
        posed = self._each(positions, "positions")
        before = [None] * count if canonical is None else self._each(canonical, "canonical positions")
        kinds = {(x.dtype, x.device) for x in posed + before if x is not None}
        if len(kinds) > 1:
            raise Error("tensors of several precisions or devices; hint: one for all")
        totals, terms = _Energies.apply(self.scenes, sample, *posed, *before)
        return (totals, terms) if self.is_batch else (totals[0], terms[0])

    def _each(self, tensors, what):
        tensors = list(tensors) if self.is_batch else [tensors]
        if len(tensors) != len(self.scenes):
            raise Error(f"{what} of {len(tensors)} scenes for {len(self.scenes)}")
        if not all(isinstance(x, torch.Tensor) for x in tensors):
            raise Error(f"{what} are tensors [V, 3]")
        return tensors


__all__ = ["PhysicsLoss", "TERMS"]
