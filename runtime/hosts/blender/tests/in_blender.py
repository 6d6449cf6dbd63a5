"""Installs the extension as a user would, learns a moving object, plays it, keys it, drags it, bakes it: in_blender.py EXTENSION.zip FOLDER

Vertices that Blender evaluates must be the runtime's.
"""

import os
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

archive, folder = (Path(word).resolve() for word in sys.argv[1:])
bpy.ops.wm.read_factory_settings(use_empty=True)
# A repository of its own, which forgets nothing and finds nothing.
repository = bpy.context.preferences.extensions.repos.new(
    name="test", module="test", custom_directory=tempfile.mkdtemp(), remote_url=""
)
repository.use_custom_directory = True
bpy.ops.extensions.package_install_files(filepath=str(archive), repo=repository.module, enable_on_install=True)
assert "bl_ext.test.sinew_blender" in bpy.context.preferences.addons, "the extension is not there"

import sinew  # noqa: E402  (it comes with the extension)

context = bpy.context


def evaluated(target):
    one = target.evaluated_get(context.evaluated_depsgraph_get())
    mesh = one.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    one.to_mesh_clear()
    return flat.reshape(-1, 3)


def agree(what, found, wanted, tolerance):
    far = np.linalg.norm(found - wanted, axis=1).max()
    print(f"{what}: {far:.2e} at most")
    assert far <= tolerance, what


# Something that moves: a sheet with a wave through it.
bpy.ops.mesh.primitive_grid_add(x_subdivisions=16, y_subdivisions=10, size=2)
sheet = context.object
wave = sheet.modifiers.new("Wave", "WAVE")
wave.height, wave.speed, wave.width = 0.4, 0.1, 0.6
package_path = folder / "sheet.sinew"
learned = bpy.ops.object.sinew_learn(filepath=str(package_path), first=1, last=60, step=3, coarse=4, fine=2)
assert learned == {"FINISHED"} and package_path.exists()

package = sinew.load(package_path)
player = package.player()
components = package.components
assert bpy.ops.object.sinew_load(filepath=str(package_path)) == {"FINISHED"}
target = context.object
agree("at rest", evaluated(target), package.rest, 0)

# Sliders.
half = np.array([0.5 * component.maximum for component in components], np.float32)
for component, weight in zip(components, half):
    target[component.name] = float(weight)
target.update_tag()
context.view_layer.update()
agree("sliders", evaluated(target), player.frame(half), 1e-6)

# Keys.
name, top = components[0].name, components[0].maximum
for component in components[1:]:
    target[component.name] = 0.0
for frame, value in ((1, 0.0), (21, top)):
    target[name] = value
    target.keyframe_insert(f'["{name}"]', frame=frame)
for frame in (1, 8, 15, 21):
    context.scene.frame_set(frame)
    weights = np.zeros(len(components), np.float32)
    weights[0] = target[name]
    agree(f"key frame {frame}", evaluated(target), player.frame(weights), 1e-6)
assert 0 < weights[0] <= top * 1.0001

# A hand: an empty on a vertex, moved.
context.scene.frame_set(1)
target.animation_data_clear()
target[name] = 0.0
target.update_tag()
context.view_layer.update()
vertex = 25
for one in target.data.vertices:
    one.select = one.index == vertex
assert bpy.ops.object.sinew_hold() == {"FINISHED"}
(empty,) = target.children
before = evaluated(target)[vertex].copy()
wanted = before + [0, 0, 0.1]
for _ in range(8):
    empty.location = wanted + np.random.default_rng(0).normal(size=3) * 1e-5
    context.view_layer.update()
    empty.location = wanted
    context.view_layer.update()
after = evaluated(target)[vertex]
print(f"dragged: from {np.linalg.norm(before - wanted):.3f} to {np.linalg.norm(after - wanted):.4f}")
assert np.linalg.norm(after - wanted) < 0.5 * np.linalg.norm(before - wanted)
assert any(abs(target[component.name]) > 1e-3 for component in components)

# A picture of the dragged sheet, to be looked at.
scene = context.scene
camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
camera.location, camera.rotation_euler = (0, -4.2, 2.6), (1.02, 0, 0)
sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
sun.data.energy, sun.rotation_euler = 3, (0.6, 0.4, 0)
for one in (camera, sun):
    scene.collection.objects.link(one)
scene.camera, scene.render.engine = camera, "CYCLES"
scene.cycles.samples, scene.render.resolution_x, scene.render.resolution_y = 16, 640, 400
scene.world = bpy.data.worlds.new("World")
scene.world.color = (0.3, 0.3, 0.3)
sheet.hide_render = True
for polygon in target.data.polygons:
    polygon.use_smooth = True
scene.render.filepath = str(folder / "dragged.png")
bpy.ops.render.render(write_still=True)
assert (folder / "dragged.png").stat().st_size > 1000

bpy.data.objects.remove(empty)

# Shape keys: a straight blend.
for component in components:
    target[component.name] = 0.0
target[name] = 0.2 * top
target.update_tag()
context.view_layer.update()
true = evaluated(target)
context.view_layer.objects.active = target
assert bpy.ops.object.sinew_shape_keys() == {"FINISHED"}
diagonal = np.linalg.norm(np.ptp(package.rest, axis=0))
agree("shape keys", evaluated(target), true, 0.1 * diagonal)
assert np.abs(evaluated(target) - package.rest).max() > 0

# What cannot be used is said.
(folder / "broken.sinew").write_bytes(package_path.read_bytes()[:-9])
for wrong in ("broken.sinew", "missing.sinew"):
    try:
        bpy.ops.object.sinew_load(filepath=str(folder / wrong))
    except RuntimeError as error:
        print(f"refused: {str(error).strip().splitlines()[0]}")
    else:
        raise AssertionError(wrong)
print("ok")
sys.stdout.flush()
# Blender's module may fall over when the interpreter ends.
os._exit(0)
