"""The four networks in PyTorch, as their authors published them, with the parameters of an exported model.

DiffusionNet with spectral diffusion, sparse gradients and complex mixing on vertices (Sharp et al.); SIREN modulated by a ReLU
network on the whole latent (Mehta et al.); latents concatenated; LBS as an einsum. Only that the garments of an outfit are
stacked into one matrix wherever a layer is per vertex is a kindness to the peer.
"""

import torch
from torch import nn


def linear(weight, bias=None):
    """nn.Linear from a weight [in, out]."""
    layer = nn.Linear(*weight.shape, bias=bias is not None)
    layer.weight.data = weight.T.contiguous()
    if bias is not None:
        layer.bias.data = bias.clone()
    return layer


class Parameters:
    """Parameters by name below a prefix."""

    def __init__(self, arrays, prefix=""):
        self.arrays, self.prefix = arrays, prefix

    def __getitem__(self, name):
        return self.arrays[self.prefix + name]

    def below(self, name):
        return Parameters(self.arrays, f"{self.prefix}{name}.")

    def count(self, name):
        """Number of entries of a list."""
        start = len(self.prefix) + len(name) + 1
        found = {key[start:].split(".")[0] for key in self.arrays if key.startswith(f"{self.prefix}{name}.")}
        return len(found)

    def linear(self, name):
        return linear(self[f"{name}.weight"], self[f"{name}.bias"])


class DiffusionBlock(nn.Module):
    def __init__(self, p):
        super().__init__()
        self.time = nn.Parameter(p["diffusion.time"].clone())
        self.real, self.imaginary = linear(p["mixing.real"]), linear(p["mixing.imaginary"])
        first = torch.cat([p["mlp.input"], p["mlp.diffused"], p["mlp.gradient"]])
        self.mlp = nn.Sequential(
            linear(first, p["mlp.bias"]), nn.ReLU(), p.linear("mlp.hidden"), nn.ReLU(), p.linear("mlp.output")
        )

    def forward(self, x, garment):
        with torch.no_grad():
            self.time.clamp_(min=1e-8)
        spectrum = garment.eigenvectors.T @ (x * garment.mass[:, None])
        spectrum = torch.exp(-garment.eigenvalues[:, None] * self.time[None, :]) * spectrum
        diffused = garment.eigenvectors @ spectrum
        gx, gy = torch.mm(garment.gradient_x, diffused), torch.mm(garment.gradient_y, diffused)
        real = self.real(gx) - self.imaginary(gy)
        imaginary = self.real(gy) + self.imaginary(gx)
        features = torch.tanh(gx * real + gy * imaginary)
        return self.mlp(torch.cat([x, diffused, features], dim=1)) + x


class DiffusionNet(nn.Module):
    def __init__(self, p):
        super().__init__()
        self.first, self.last = p.linear("first"), p.linear("last")
        self.blocks = nn.ModuleList(DiffusionBlock(p.below(f"blocks.{i}")) for i in range(p.count("blocks")))

    def forward(self, garment):
        x = self.first(garment.rest)
        for block in self.blocks:
            x = block(x, garment)
        return self.last(x)


class Perceptron(nn.Module):
    """GELU layers; after the first, pairs bridged by a residual."""

    def __init__(self, first, p):
        super().__init__()
        self.first, self.output = first, p.linear("output")
        self.hidden = nn.ModuleList(p.linear(f"hidden.{i}") for i in range(p.count("hidden")))

    def forward(self, x):
        gelu = nn.functional.gelu
        x = gelu(self.first(x))
        for i in range(0, len(self.hidden), 2):
            inner = gelu(self.hidden[i](x))
            x = x + gelu(self.hidden[i + 1](inner)) if i + 1 < len(self.hidden) else inner
        return self.output(x)


class ModulatedSiren(nn.Module):
    def __init__(self, p, omega_first, omega_hidden):
        super().__init__()
        layers = p.count("sine")
        self.sine = nn.ModuleList(p.linear(f"sine.{i}") for i in range(layers))
        self.output = p.linear("output")
        width = self.sine[0].out_features
        modulator = []
        for layer in range(layers):
            block = slice(layer * width, (layer + 1) * width)
            parts = [p["modulator.garment"][:, block], p["modulator.vertex"][:, block]]
            if layer > 0:
                parts.insert(0, p[f"modulator.hidden.{layer - 1}"])
            modulator.append(linear(torch.cat(parts), p["modulator.bias"][block]))
        self.modulator = nn.ModuleList(modulator)
        self.omegas = [omega_first] + [omega_hidden] * (layers - 1)

    def forward(self, x, latent):
        gate = None
        for omega, sine, modulator in zip(self.omegas, self.sine, self.modulator):
            gate = torch.relu(modulator(latent if gate is None else torch.cat([gate, latent], dim=1)))
            x = torch.sin(omega * sine(x)) * gate
        return self.output(x)


class ClothCombo(nn.Module):
    def __init__(self, arrays, config):
        super().__init__()
        p = Parameters(arrays)
        self.config = config
        omegas = config["omega_first"], config["omega_hidden"]
        self.encoder = DiffusionNet(p.below("garment_encoder.diffusion_net"))
        self.embedding = Perceptron(p.linear("draping.embedding.first"), p.below("draping.embedding"))
        self.displacement = ModulatedSiren(p.below("draping.displacement"), *omegas)
        s = p.below("skinning")
        first = torch.cat([s["coordinate"], s["garment"], s["vertex"]])
        self.skinning = Perceptron(linear(first, s["bias"]), s)
        self.force = Perceptron(p.linear("untangling.force.first"), p.below("untangling.force"))
        self.untangling = ModulatedSiren(p.below("untangling.displacement"), *omegas)

    def encode(self, outfit):
        """Vertex embeddings [ΣV,d] and garment embeddings [M,d]."""
        vertex = [self.encoder(garment) for garment in outfit.garments]
        mean = [(garment.mass[:, None] * z).sum(0) / garment.mass.sum() for garment, z in zip(outfit.garments, vertex)]
        return torch.cat(vertex), torch.stack(mean)

    def forward(self, outfit, embeddings=None, with_single=False):
        """Posed and canonical positions [ΣV,3]; with `with_single` also those of the single garments."""
        vertex, garment = self.encode(outfit) if embeddings is None else embeddings
        config, of = self.config, outfit.of_vertex
        body = torch.cat([outfit.shape, outfit.pose])[None].expand(len(garment), -1)
        draping = self.embedding(torch.cat([garment, body], dim=1))
        rows = draping[of]
        displacement = self.displacement(outfit.rest, torch.cat([rows, vertex], dim=1))
        canonical = outfit.start + config["displacement_scale"] * displacement
        raw = self.skinning(torch.cat([outfit.rest, rows, vertex], dim=1))
        mask = outfit.mask[of]
        raw = raw * mask
        if config["zero_sum_skinning"]:
            raw = raw - mask * raw.sum(1, keepdim=True) / mask.sum(1, keepdim=True)
        transforms = torch.einsum("vj,jab->vab", outfit.weights + config["skinning_scale"] * raw, outfit.bones)
        pose = lambda x: torch.einsum("vab,vb->va", transforms[:, :, :3], x) + transforms[:, :, 3]
        moves = outfit.moves
        single = (pose(canonical), canonical) if with_single or not moves else ()
        if not moves:
            return single + single if with_single else single
        i, j = outfit.edges
        forces = self.force(torch.cat([draping[i], draping[j]], dim=1))
        below, above = torch.zeros_like(draping), torch.zeros_like(draping)
        below = below.index_add(0, i[outfit.from_below], forces[outfit.from_below])
        above = above.index_add(0, i[outfit.from_above], forces[outfit.from_above])
        latent = torch.cat([torch.cat([below, above, draping], dim=1)[of], vertex], dim=1)
        moved = self.untangling(canonical, latent) * config["untangling_scale"] * outfit.touched[of]
        return (pose(canonical + moved), canonical + moved) + single
