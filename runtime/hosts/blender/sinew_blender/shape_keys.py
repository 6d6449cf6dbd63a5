"""A driven object without Sinew: a shape key for each component, as near as a straight blend comes."""

import bpy
import numpy as np
import sinew

from .play import PACKAGE, played


def targets(now):
    """For each component its straight blend at weight 1 (V, 3) as an offset, and how far the true movement is from it at most."""
    rest = now.player.frame(np.zeros(len(now.components), np.float32))
    for k, component in enumerate(now.components):
        weights = [end * step / 4 for end in (component.minimum, component.maximum) for step in range(1, 5) if end != 0]
        poses = []
        for weight in weights:
            row = np.zeros(len(now.components), np.float32)
            row[k] = weight
            poses.append(now.player.frame(row) - rest)
        if not poses:
            yield component, np.zeros_like(rest), 0.0
            continue
        offset = sum(weight * pose for weight, pose in zip(weights, poses)) / sum(weight**2 for weight in weights)
        far = max(np.linalg.norm(pose - weight * offset, axis=1).max() for weight, pose in zip(weights, poses))
        yield component, offset, far


class SINEW_OT_shape_keys(bpy.types.Operator):
    """Turn the components of the active object into shape keys, with its animation; the object needs no Sinew then"""

    bl_idname = "object.sinew_shape_keys"
    bl_label = "Bake to shape keys"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and PACKAGE in context.object

    def execute(self, context):
        target = context.object
        try:
            now = played(target)
        except sinew.SinewError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if target.data.shape_keys is not None:
            self.report({"ERROR"}, f"{target.name} has shape keys already")
            return {"CANCELLED"}
        rest = now.player.frame(np.zeros(len(now.components), np.float32))
        diagonal = np.linalg.norm(np.ptp(rest, axis=0))
        basis = target.shape_key_add(name="Basis", from_mix=False)
        basis.data.foreach_set("co", rest.ravel())
        farthest = 0.0
        for component, offset, far in targets(now):
            key = target.shape_key_add(name=component.name, from_mix=False)
            key.data.foreach_set("co", (rest + offset).ravel())
            # Blender's own bounds of a shape key.
            key.slider_min, key.slider_max = max(component.minimum, -10.0), min(component.maximum, 10.0)
            key.value = target[component.name]
            farthest = max(farthest, far)
        keys = target.data.shape_keys
        action = target.animation_data.action if target.animation_data else None
        if action is not None:
            for curve in list(action.fcurves):
                name = curve.data_path[2:-2]
                if name in keys.key_blocks:
                    for point in curve.keyframe_points:
                        frame, value = point.co
                        keys.key_blocks[name].value = value
                        keys.key_blocks[name].keyframe_insert("value", frame=frame)
        del target[PACKAGE]
        self.report({"INFO"}, f"straight blends are {100 * farthest / diagonal:.2f} % of the diagonal from the movement at most")
        return {"FINISHED"}


CLASSES = (SINEW_OT_shape_keys,)
