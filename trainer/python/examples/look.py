"""A look at what is learned, cell by cell: run it whole, or open it in an editor that knows `# %%` cells as a notebook.

    python look.py [FOLDER_OR_FILE]        pictures go beside it: components.png, errors.png; needs matplotlib
"""

# %% A sequence: what `sinew.read` takes, or a flag that nobody filmed
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from ten_lines import flag

import sinew

positions, faces = sinew.read(sys.argv[1]) if len(sys.argv) > 1 else flag()
print(positions.shape, faces.shape)

# %% Learn from one shape in four, with a bar
EVERY = 4


def bar(stage, done, total, note):
    print(f"\r{stage:<26}{done:>5}/{total:<5} {note:<20}", end="", flush=True)


package = sinew.train(positions, faces, shapes=range(0, len(positions), EVERY), components=(4, 2), progress=bar)
print("\n", package)

# %% Each component at the end of its range that reaches farther: where it moves the mesh, and how far
player = package.player()
rest = package.rest
wide, high = np.argsort(np.ptp(rest, axis=0))[:0:-1]
figure, axes = plt.subplots(2, 6, figsize=(15, 5), subplot_kw={"aspect": "equal"})
for k, (component, axis) in enumerate(zip(package.components, axes.flat)):
    weights = np.zeros(len(package.components), np.float32)
    weights[k] = max(component.minimum, component.maximum, key=abs)
    moved = player.frame(weights)
    far = np.linalg.norm(moved - rest, axis=1)
    axis.tripcolor(moved[:, wide], moved[:, high], faces, far, shading="gouraud", cmap="magma_r")
    axis.set_title(f"{component.name}  {far.max():.2f}")
for axis in axes.flat:
    axis.axis("off")
figure.tight_layout()
figure.savefig("components.png", dpi=80)

# %% Shapes that were never seen, by the encoder and by a search: how far each is played from the truth
unseen = [n for n in range(len(positions)) if n % EVERY]


def laid_upon(shape, truth):
    """The shape turned and moved to where the truth is: where a shape stands does not matter to Sinew."""
    shape, middle = shape - shape.mean(0), truth.mean(0)
    u, _, v = np.linalg.svd(shape.T @ (truth - middle))
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
    return shape @ turn + middle


def distance(fit):
    weights = package.encode(positions[unseen], fit=fit)
    far = [laid_upon(player.frame(row), truth) - truth for row, truth in zip(weights, positions[unseen])]
    return [np.sqrt((offset**2).sum(1).mean()) for offset in far]


figure, axis = plt.subplots(figsize=(8, 3))
for fit in ("encoder", "positions"):
    axis.plot(unseen, distance(fit), label=fit)
axis.set(xlabel="shape", ylabel="rms distance, units of the source", ylim=(0, None))
axis.legend()
figure.tight_layout()
figure.savefig("errors.png", dpi=80)
print({name: round(figures["e_rms"], 2) for name, figures in package.evaluate(positions).items() if isinstance(figures, dict) and "e_rms" in figures})
