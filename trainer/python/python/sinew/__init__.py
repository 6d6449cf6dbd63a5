"""Sinew: learns a small, readable set of deformation components from a mesh sequence and plays them in real time.

Train on arrays, keep one compact package, play it::

    package = sinew.train(positions, faces)          # positions: shapes x vertices x 3
    package.save("walk.sinew")
    player = package.player()
    mesh = player.frame(package.encode(positions)[5])

Arrays are float32; others are converted where they come in, and refused where results go out.
"""

from ._sinew import Component, Package, Player, SinewError, load, read, train

__all__ = ["Component", "Package", "Player", "SinewError", "load", "read", "train"]
