from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Component", "Package", "Player", "SinewError", "load", "read", "train"]

class SinewError(ValueError):
    """Sinew refuses an input; the text says what is wrong and what to do."""

@final
class Component:
    """One component and its control."""

    @property
    def name(self) -> str: ...
    @property
    def minimum(self) -> float:
        """Lower stop of the control; at most 0, which is rest."""
    @property
    def maximum(self) -> float:
        """Upper stop of the control; at least 0."""
    @property
    def level(self) -> int:
        """0 for the coarse ones."""
    @property
    def parent(self) -> int | None:
        """Index of the component above it."""

def load(path: str | PathLike[str]) -> Package:
    """A package from a file, compact or baked. Refuses damaged ones and those of other versions."""

def read(
    path: str | PathLike[str], *, mesh: Sequence[str] | None = None, clip: str | None = None
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Positions, shape (N, V, 3), and faces, shape (F, 3), of a sequence: a folder of meshes or arrays, or a file of another program in
    which a mesh moves (Alembic, USD, glTF, PC2, MDD, Maya caches, MD2; not FBX). With several meshes or clips the error names them.
    """

def train(
    positions: ArrayLike,
    faces: ArrayLike,
    *,
    shapes: Iterable[int] | None = None,
    components: Sequence[int] | None = None,
    seed: int | None = None,
    epochs: int | None = None,
    recipe: Literal["local", "paper"] = "local",
    config: str | None = None,
    paint: Mapping[str, Sequence[int]] | None = None,
    time_budget: float | None = None,
    progress: Callable[[str, int, int, str], object] | None = None,
) -> Package:
    """Learns a compact package.

    The same input, settings and seed give the same bytes, unless `time_budget` cuts the run. Ctrl-C stops it with
    KeyboardInterrupt; an exception of `progress` stops it, too. Notices come as warnings.

    positions: shape (N, V, 3), units and axes of your own; shape 0 is the reference.
    faces: shape (F, 3), counter-clockwise seen from outside.
    shapes: numbers of the shapes to train on, from 0; all by default. The others are left for `Package.evaluate`.
    components: of each level, coarse to fine; (10, 5) makes 10 coarse ones with 5 fine ones under each.
    seed: of every random choice; 0 by default.
    epochs: steps of the optimiser; 0 by default, which refines the closed-form start alone.
    config: settings as TOML text, as `sinew inspect --config` prints them.
    paint: vertices from 0 where a coarse component of that name lives.
    time_budget: seconds for choosing and fitting.
    progress: called with stage, parts done, parts in all, and a note, on the calling thread.
    """

@final
class Package:
    """Bytes of a package, checked. Compact ones are what training makes: they encode, evaluate and bake. Both kinds play."""

    @staticmethod
    def from_bytes(bytes: bytes) -> Package: ...
    def to_bytes(self) -> bytes: ...
    def save(self, path: str | PathLike[str]) -> None:
        """Writes a file, whole or not at all."""
    @property
    def kind(self) -> Literal["compact", "baked"]: ...
    @property
    def vertex_count(self) -> int: ...
    @property
    def bone_count(self) -> int:
        """0 where there are none, as in a compact package."""
    @property
    def faces(self) -> NDArray[np.uint32]:
        """Shape (F, 3)."""
    @property
    def rest(self) -> NDArray[np.float32]:
        """Shape (V, 3), in the order and units of the source."""
    @property
    def components(self) -> list[Component]: ...
    def bake(self, *, bones: int | None = 128, influences: Literal[4, 8] = 4, exact: bool = True) -> Package:
        """Ready for engines: with bones that a GPU skins by (at most 250), and with the exact tier or without."""
    def encode(
        self, positions: ArrayLike, *, fit: Literal["encoder", "features", "positions"] = "encoder"
    ) -> NDArray[np.float32]:
        """Weights of shapes of the same mesh, shape (N, K); positions have shape (N, V, 3). Not held within the stops."""
    def evaluate(self, positions: ArrayLike, *, shapes: Iterable[int] | None = None) -> dict[str, Any]:
        """Figures on shapes that were not trained on, as `sinew evaluate --json` prints them."""
    def player(self, tier: Literal["exact", "bones"] | None = None) -> Player:
        """A player at rest, of the nearest tier by default. A compact package is baked for it."""
    def __len__(self) -> int:
        """Bytes."""
    def __eq__(self, other: object) -> bool: ...

@final
class Player:
    """Plays a package. One thread at a time; others run meanwhile, for nothing holds the interpreter's lock while it computes."""

    @property
    def tier(self) -> Literal["exact", "bones"]: ...
    @property
    def weights(self) -> NDArray[np.float32]:
        """A copy, shape (K,)."""
    def frame(
        self,
        weights: ArrayLike | None = None,
        out: NDArray[np.float32] | None = None,
        normals: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Positions, shape (V, 3), written into `out` without a copy, and unit normals into `normals`, where they are given.

        weights: shape (K,), not held within the stops; those of the last call or drag by default.
        """
    def bones(
        self, weights: ArrayLike | None = None, out: NDArray[np.float32] | None = None
    ) -> NDArray[np.float32]:
        """Maps of the bones, shape (B, 12): 3 x 4 row by row, from positions of the rest shape to posed ones."""
    def hold(self, vertex: int) -> None:
        """Takes hold of a vertex where the last frame has it."""
    def drag(self, vertex: int, target: Sequence[float]) -> float:
        """Moves the weights so that a held vertex comes to a point, and others that are held stay; returns the largest
        distance left, in units of the source. A far target takes several calls."""
    def let_go(self, vertex: int) -> None: ...
