import subprocess
import sys
from pathlib import Path

import clothcombo
import numpy as np
import pytest

torch = pytest.importorskip("torch")

from clothcombo.torch import PhysicsLoss
from test_scene import meshes, scene, state


def tensors(dtype=torch.float64):
    return [torch.tensor(x, dtype=dtype, requires_grad=True) for x in state()]


@pytest.mark.parametrize("term", clothcombo.TERMS)
def test_autograds_check_passes(term):
    losses = {name: {"weight": float(name == term)} for name in clothcombo.TERMS}
    losses["repulsion"]["subset"] = 0
    loss = PhysicsLoss(scene({"reference_vertices": 0.0, **losses}, dtype=np.float64))
    posed, canonical = tensors()
    assert loss(posed, canonical)[0] != 0
    # Every 40th coordinate: the others stay as they are.
    chosen = torch.arange(0, posed.numel(), 40)

    def of_chosen(x, y):
        place = lambda all, some: all.detach().reshape(-1).index_put((chosen,), some).reshape(all.shape)
        return loss(place(posed, x), place(canonical, y))[0]

    inputs = [x.detach().reshape(-1)[chosen].requires_grad_() for x in (posed, canonical)]
    assert torch.autograd.gradcheck(of_chosen, inputs, eps=1e-7, atol=1e-6, rtol=1e-4)


def test_values_and_gradients_are_those_of_the_scene():
    one = scene()
    posed, canonical = tensors()
    loss, terms = PhysicsLoss(one)(posed, canonical)
    (3 * loss).backward()
    energies, gradient, of_canonical = one(posed.detach().numpy(), canonical.detach().numpy())
    assert loss.item() == energies["total"] and terms.tolist() == [energies[t] for t in clothcombo.TERMS]
    assert not terms.requires_grad
    assert np.allclose(posed.grad, 3 * gradient, rtol=1e-12) and np.allclose(canonical.grad, 3 * of_canonical, rtol=1e-12)


def test_a_batch_is_a_sum_of_scenes():
    one = scene()
    moved = one.on_body(meshes()[0][0] + [0.01, 0, 0])
    posed, canonical = tensors(torch.float32)
    stack = torch.stack([posed, posed])
    losses, terms = PhysicsLoss([one, moved])(stack, torch.stack([canonical, canonical]))
    assert losses.shape == (2,) and terms.shape == (2, 8) and losses.dtype == torch.float32
    (losses * torch.tensor([1.0, 2.0])).sum().backward()
    expected = torch.zeros_like(posed)
    for factor, single in ((1, one), (2, moved)):
        x = posed.detach().clone().requires_grad_()
        (factor * PhysicsLoss(single)(x, canonical.detach())[0]).backward()
        expected += x.grad
    assert torch.allclose(posed.grad, expected, rtol=1e-5)


def test_what_has_no_gradient_is_refused():
    body, garments = meshes()
    posed, canonical = tensors()
    with pytest.raises(clothcombo.Error, match="requires grad"):
        clothcombo.Scene(garments, (torch.tensor(body[0], requires_grad=True), body[1]))
    density = torch.tensor(300.0, requires_grad=True)
    with pytest.raises(clothcombo.Error, match="requires grad"):
        clothcombo.Scene(garments, body, losses={"material": {"density": density}})
    loss = PhysicsLoss(scene())(posed, canonical)[0]
    (gradient,) = torch.autograd.grad(loss, posed, create_graph=True)
    with pytest.raises(clothcombo.Error, match="differentiated once"):
        gradient.sum().backward()
    with pytest.raises(clothcombo.Error, match="float16"):
        PhysicsLoss(scene())(posed.half(), canonical.half())
    with pytest.raises(clothcombo.Error, match="for 2"):
        PhysicsLoss([scene(), scene()])([posed], [canonical])


def test_a_tensor_is_read_in_place_and_a_network_learns():
    one = scene()
    network = torch.nn.Linear(3, 3)
    for parameter in network.parameters():
        torch.nn.init.zeros_(parameter)
    posed, canonical = (x.detach() for x in tensors(torch.float32))
    loss, optimizer = PhysicsLoss(one), torch.optim.Adam(network.parameters(), 3e-3)
    history = []
    for step in range(20):
        optimizer.zero_grad()
        value, _ = loss(posed + network(posed), canonical, sample=step)
        value.backward()
        optimizer.step()
        history.append(value.item())
    assert history[-1] < 0.98 * history[0]


def test_the_networks_are_those_of_the_program(program, tmp_path):
    sizes = ["--widths", "16", "--layers", "2", "--vertices", "200", "--set", "model.corrections=0"]
    command = [program, "bench", "step", *sizes, "--export", str(tmp_path / "scene"), "--export-only"]
    subprocess.run(command, check=True, capture_output=True)
    sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
    import networks

    assert networks.main(tmp_path / "scene") < 1e-4
