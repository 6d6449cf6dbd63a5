"""Plays a file in Blender and measures frames against the runtime's positions: blender.py FILE.glb POSITIONS.npy

The distances must be those that the file itself names.
"""

import json
import os
import struct
import sys

import bpy
import numpy as np

file, array = sys.argv[1:]
exact = np.load(array)
with open(file, "rb") as stream:
    length = struct.unpack("<12xI4x", stream.read(20))[0]
    (said,) = json.loads(stream.read(length))["nodes"][0]["extras"]["sinew"]["clips"]

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 24
bpy.ops.import_scene.gltf(filepath=file, merge_vertices=False)
(mesh,) = (o for o in bpy.data.objects if o.type == "MESH" and len(o.data.vertices) == exact.shape[1])


def positions(data):
    flat = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", flat)
    return flat.reshape(-1, 3)


rest = positions(mesh.data)
diagonal = np.linalg.norm(rest.max(0) - rest.min(0))
distances = []
for frame, shape in enumerate(exact):
    bpy.context.scene.frame_set(frame)
    evaluated = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = np.array(evaluated.matrix_world)
    x, y, z = (positions(evaluated.to_mesh()) @ world[:3, :3].T + world[:3, 3]).T
    # Blender's z points up.
    distances.append(np.linalg.norm(np.stack([x, z, -y], 1) - shape, axis=1) / diagonal)
rms, most = np.sqrt(np.mean(np.square(distances))), np.max(distances)
print(f"Blender {bpy.app.version_string}: {len(exact)} frames, rms {rms:.4%}, most {most:.4%}; the file says {said['rms']:.4%}")
sys.stdout.flush()
# Blender's module may fall over when the interpreter ends.
os._exit(0 if abs(rms - said["rms"]) < 1e-5 and abs(most - said["max"]) < 1e-4 else 1)
