"""The two-level network of Sinew in PyTorch on the CPU, for the benchmark `epoch`.

The same algebra as the fused kernel: the decoder's convolution is applied to C and not to the shapes, the neighbour
means of the shapes are computed once, all blocks of the second level go as one batch, features come before shapes so
that every product is one large matrix product. The optimiser is PyTorch's fused Adam.

    epoch.py FOLDER SHAPES EPOCHS THREADS

FOLDER holds what the benchmark wrote, little endian and flat: edges.u32 [E][2] (receiver, giver), weights.f32 [V],
shapes.f32 [N][V][9], and of each level l components-l.f32 [B][K][V][9], convolutions-l.f32 [B][encoder, decoder][171].
Prints one line of JSON: the loss of the first epoch, and seconds of wall and CPU time an epoch after that one.
"""

import json
import sys
import time
import warnings
from pathlib import Path

import torch

# Sparse tensors call themselves a beta.
warnings.simplefilter("ignore")

FEATURES = 9
# The paper's settings, as `LossSettings::paper`.
RECONSTRUCTION, RANGE, SPARSITY_DISTANCES = 10.0, 5.0, [0.4, 0.2]
SOFTENING = 1e-6
MASK_FLOOR = 1e-6
BLOCKS = [(1, 10), (10, 5)]


class RingMean(torch.autograd.Function):
    """Rows of a dense matrix averaged over rings: a sparse product there, one with the transpose back."""

    @staticmethod
    def forward(context, values, mean, transposed):
        context.transposed = transposed
        return torch.sparse.mm(mean, values)

    @staticmethod
    def backward(context, gradient):
        return torch.sparse.mm(context.transposed, gradient.contiguous()), None, None


def numbers(folder, name, shape, kind=torch.float32):
    data = bytearray((folder / name).read_bytes())
    return torch.frombuffer(data, dtype=kind).reshape(shape).clone()


class Network:
    def __init__(self, folder, shape_count):
        self.vertex_weights = numbers(folder, "weights.f32", [-1])
        self.vertex_count = vertices = self.vertex_weights.shape[0]
        edges = numbers(folder, "edges.u32", [-1, 2], torch.int32).long()
        degrees = torch.bincount(edges[:, 0], minlength=vertices).float()
        shares = 1.0 / degrees[edges[:, 0]]
        size = (vertices, vertices)
        mean = torch.sparse_coo_tensor(edges.T, shares, size).coalesce()
        self.mean = mean.to_sparse_csr()
        self.transposed = mean.transpose(0, 1).coalesce().to_sparse_csr()
        shapes = numbers(folder, "shapes.f32", [shape_count, vertices, FEATURES])
        # [B, 9, V, N]
        self.shapes = shapes.permute(2, 1, 0).unsqueeze(0).contiguous()
        self.levels = []
        for level, (blocks, count) in enumerate(BLOCKS):
            components = numbers(folder, f"components-{level}.f32", [blocks, count, vertices, FEATURES])
            flat = numbers(folder, f"convolutions-{level}.f32", [blocks, 2, 171])
            matrices = flat[:, :, :162].reshape(blocks, 2, 2, FEATURES, FEATURES)
            parameters = {
                # [B, K, 9, V]
                "components": components.permute(0, 1, 3, 2).contiguous(),
                # [B, encoder or decoder, 9, point and neighbour 18]
                "matrices": torch.cat([matrices[:, :, 0], matrices[:, :, 1]], dim=3).contiguous(),
                "biases": flat[:, :, 162:].unsqueeze(3).contiguous(),
            }
            for parameter in parameters.values():
                parameter.requires_grad_(True)
            self.levels.append(parameters)
        with torch.no_grad():
            self.shapes_with_means = self.with_means(self.shapes)
            index = torch.arange(vertices)
            self.outside = []
            for level, distance in zip(self.levels, SPARSITY_DISTANCES):
                # Centres are where components are longest; distances are those that the benchmark makes up.
                centres = level["components"].square().sum(2).argmax(2)
                away = (index - centres.unsqueeze(2)).abs().float() / (vertices - 1)
                self.outside.append((away >= distance).float())

    def parameters(self):
        return [parameter for level in self.levels for parameter in level.values()]

    def with_means(self, fields):
        """Fields [B, 9, V, R] over their neighbour means: [B, 18, V R]."""
        blocks, _, vertices, rows = fields.shape
        flat = fields.permute(2, 0, 1, 3).reshape(vertices, -1)
        means = RingMean.apply(flat, self.mean, self.transposed)
        means = means.reshape(vertices, blocks, FEATURES, rows).permute(1, 2, 0, 3)
        return torch.cat([fields, means], dim=1).reshape(blocks, 2 * FEATURES, -1)

    def loss(self):
        shape_count = self.shapes.shape[3]
        fields, stacked = self.shapes, self.shapes_with_means
        total = 0.0
        for level, outside in zip(self.levels, self.outside):
            components, matrices, biases = level["components"], level["matrices"], level["biases"]
            blocks, count = components.shape[:2]
            encoder, decoder = biases[:, 0], biases[:, 1]
            hidden = torch.tanh(torch.baddbmm(encoder, matrices[:, 0], stacked)) - torch.tanh(encoder)
            rows = components.reshape(blocks, count, -1)
            latents = torch.bmm(rows, hidden.reshape(blocks, -1, shape_count))
            # [B, 9, V, K] -> [B, 9 V, K]
            turned = self.with_means(components.permute(0, 2, 3, 1))
            hat = torch.bmm(matrices[:, 1], turned).reshape(blocks, -1, count)
            blend = torch.bmm(hat, latents).reshape(blocks, FEATURES, -1)
            answer = torch.tanh(blend + decoder) - torch.tanh(decoder)
            residual = fields - answer.reshape(blocks, FEATURES, self.vertex_count, shape_count)
            energy = residual.square().sum((0, 1, 3))
            total = total + RECONSTRUCTION / shape_count * torch.dot(energy, self.vertex_weights)
            squares = components.square().sum(2)
            norms = (squares + SOFTENING * SOFTENING).sqrt() - SOFTENING
            total = total + (norms * outside).sum() / count
            excess = (latents.abs().amax(2) - RANGE).clamp_min(0.0)
            total = total + excess.sum() / count
            if level is not self.levels[-1]:
                raised = squares + MASK_FLOOR / self.vertex_count
                masks = raised / raised.sum(1, keepdim=True)
                fields = residual * masks.squeeze(0)[:, None, :, None]
                stacked = self.with_means(fields)
        return total


def main():
    folder, shape_count, epochs, threads = Path(sys.argv[1]), *map(int, sys.argv[2:5])
    torch.set_num_threads(threads)
    network = Network(folder, shape_count)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3, fused=True)

    def epoch():
        optimiser.zero_grad(set_to_none=True)
        loss = network.loss()
        loss.backward()
        optimiser.step()
        return loss.item()

    first = epoch()
    walls, cpus = [], []
    for _ in range(epochs):
        wall, cpu = time.perf_counter(), time.process_time()
        epoch()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    middle = lambda values: sorted(values)[len(values) // 2]
    print(json.dumps({"torch": torch.__version__, "loss": first, "wall": middle(walls), "cpu": middle(cpus)}))


main()
