"""Sinew in Blender: learn an object's movement, play it by sliders that can be animated, drag it by empties, bake it to shape keys."""

import bpy

from . import learn, panel, play, shape_keys

MODULES = (learn, play, shape_keys, panel)


def register():
    for module in MODULES:
        for one in module.CLASSES:
            bpy.utils.register_class(one)
    play.listen()


def unregister():
    play.forget()
    for module in reversed(MODULES):
        for one in reversed(module.CLASSES):
            bpy.utils.unregister_class(one)
