"""An object that moves, or has shape keys, becomes a package: modifiers, simulations and caches are evaluated frame by frame."""

import threading

import bpy
import numpy as np
import sinew
from bpy.props import EnumProperty, IntProperty, StringProperty

from .meshes import faces_of, positions_of


def frames(context, source, first, last, step):
    """Positions of the frames (N, V, 3) and faces (F, 3) of an object. The first frame is the reference."""
    scene, now = context.scene, context.scene.frame_current
    shapes, faces = [], None
    try:
        for frame in range(first, last + 1, step):
            scene.frame_set(frame)
            evaluated = source.evaluated_get(context.evaluated_depsgraph_get())
            mesh = evaluated.to_mesh()
            shapes.append(positions_of(mesh))
            if len(shapes[-1]) != len(shapes[0]):
                raise sinew.SinewError(
                    f"{source.name} has {len(shapes[0])} vertices in frame {first} and {len(shapes[-1])} in frame {frame}: "
                    "switch off modifiers that make vertices anew"
                )
            faces = faces_of(mesh) if faces is None else faces
            evaluated.to_mesh_clear()
    finally:
        scene.frame_set(now)
    return np.stack(shapes), faces


def shape_keys(source):
    """The same of the shape keys, of which the first is the reference."""
    if source.data.shape_keys is None:
        raise sinew.SinewError(f"{source.name} has no shape keys")
    shapes = []
    for key in source.data.shape_keys.key_blocks:
        flat = np.empty(3 * len(key.data), np.float32)
        key.data.foreach_get("co", flat)
        shapes.append(flat.reshape(-1, 3))
    return np.stack(shapes), faces_of(source.data)


class Learning(threading.Thread):
    """A training beside Blender."""

    def __init__(self, positions, faces, components):
        super().__init__(name="sinew")
        self.arguments = {"positions": positions, "faces": faces, "components": components}
        self.stopped = False
        self.done, self.total, self.stage = 0, 0, ""
        self.package, self.error = None, None

    def heard(self, stage, done, total, _note):
        self.stage, self.done, self.total = stage, done, total
        if self.stopped:
            raise KeyboardInterrupt

    def run(self):
        try:
            self.package = sinew.train(**self.arguments, progress=self.heard)
        except KeyboardInterrupt:
            self.error = "stopped"
        except Exception as error:  # whatever it is, the artist must see it
            self.error = str(error)


class SINEW_OT_learn(bpy.types.Operator):
    """Learn components from the active object's movement, and write a package"""

    bl_idname = "object.sinew_learn"
    bl_label = "Learn components"

    filepath: StringProperty(subtype="FILE_PATH", name="Package")
    filter_glob: StringProperty(default="*.sinew", options={"HIDDEN"})
    source: EnumProperty(
        name="Source",
        items=[
            ("FRAMES", "Frames", "Every frame, with modifiers, simulations and caches"),
            ("SHAPE_KEYS", "Shape keys", "Every shape key"),
        ],
    )
    first: IntProperty(name="First frame", default=1)
    last: IntProperty(name="Last frame", default=250)
    step: IntProperty(name="Step", default=1, min=1)
    coarse: IntProperty(name="Coarse components", default=10, min=1, max=64)
    fine: IntProperty(name="Fine ones under each", default=5, min=0, max=64)

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def invoke(self, context, _event):
        self.first, self.last = context.scene.frame_start, context.scene.frame_end
        self.filepath = self.filepath or f"{context.object.name}.sinew"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def begin(self, context):
        if self.source == "SHAPE_KEYS":
            positions, faces = shape_keys(context.object)
        else:
            positions, faces = frames(context, context.object, self.first, self.last, self.step)
        components = [self.coarse, self.fine] if self.fine else [self.coarse]
        self.learning = Learning(positions, faces, components)
        self.learning.start()

    def end(self):
        learning = self.learning
        learning.join()
        if learning.error is not None:
            self.report({"ERROR"}, learning.error)
            return {"CANCELLED"}
        try:
            learning.package.save(bpy.path.abspath(self.filepath))
        except sinew.SinewError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{self.filepath}: {len(learning.package.components)} components")
        return {"FINISHED"}

    def execute(self, context):
        try:
            self.begin(context)
        except sinew.SinewError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if bpy.app.background:
            return self.end()
        self.timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        learning = self.learning
        if event.type == "ESC":
            learning.stopped = True
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if learning.is_alive():
            context.workspace.status_text_set(f"Sinew: {learning.stage} {learning.done}/{learning.total}, Esc stops")
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)
        return self.end()


CLASSES = (SINEW_OT_learn,)
