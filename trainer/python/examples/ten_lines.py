"""A flag that nobody filmed: train on it, encode it, play it. Ten lines without the making up."""

import numpy as np

import sinew


def flag(shapes=40, across=14, down=9):
    """Positions (shapes x vertices x 3) and faces of a sheet in which waves run."""
    x, y = np.meshgrid(np.linspace(0, 2, across), np.linspace(0, 1, down))
    index = np.arange(across * down).reshape(down, across)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    waves = [0.15 * x * np.sin(4 * x - 0.3 * n) + 0.1 * y * x * np.cos(0.21 * n) for n in range(shapes)]
    waves[0] = np.zeros_like(x)
    return np.stack([np.stack([x, y, z], -1).reshape(-1, 3) for z in waves]).astype(np.float32), faces


def main():
    positions, faces = flag()
    package = sinew.train(positions, faces, shapes=range(0, 40, 4), components=(4, 2))
    print(package)
    weights = package.encode(positions, fit="positions")
    player, mesh = package.player(), np.empty_like(positions[0])
    for row, truth in zip(weights, positions):
        player.frame(row, out=mesh)
    print("largest weight", np.abs(weights).max(), "of", [component.name for component in package.components])
    print("position projection", package.evaluate(positions)["position_projection"])


if __name__ == "__main__":
    main()
