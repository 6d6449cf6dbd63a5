"""An object driven by a package: a custom property for each component, which can be keyed and driven, and empties that drag.

Path of data: properties (or empties) -> weights -> the package's player -> vertices of the object's mesh, after every change of frame and
of a property.
"""

import bpy
import numpy as np
import sinew
from bpy.app.handlers import persistent
from bpy.props import StringProperty

from .meshes import positions_of, write

PACKAGE = "sinew_package"
VERTEX = "sinew_vertex"
# Steps of a drag in one update: a far target is reached in a few.
STEPS = 4


class Played:
    """What is kept of a driven object while Blender runs."""

    def __init__(self, path):
        self.path = path
        package = sinew.load(bpy.path.abspath(path))
        self.components = package.components
        self.player = package.player()
        self.out = np.empty((package.vertex_count, 3), np.float32)
        self.weights = None
        self.held = {}


# By the object's name; rebuilt when its package's path changes.
playing = {}


def played(target):
    """The player of a driven object."""
    path = target[PACKAGE]
    if target.name not in playing or playing[target.name].path != path:
        playing[target.name] = Played(path)
    return playing[target.name]


def weights_of(target, components):
    return np.array([target.get(component.name, 0.0) for component in components], np.float32)


def empties(target):
    return [child for child in target.children if VERTEX in child]


def drag(target, now):
    """Moves the weights by the empties that were moved. Returns whether there was one."""
    handles = {child[VERTEX]: np.array(child.matrix_local.translation) for child in empties(target)}
    for vertex in set(now.held) - set(handles):
        now.player.let_go(vertex)
        del now.held[vertex]
    moved = False
    for vertex, place in handles.items():
        if vertex not in now.held:
            now.player.hold(vertex)
            now.held[vertex] = place
        elif np.abs(now.held[vertex] - place).max() > 1e-6:
            for _ in range(STEPS):
                now.player.drag(vertex, list(map(float, place)))
            now.held[vertex] = place
            moved = True
    if moved:
        now.weights = now.player.weights
        for component, weight in zip(now.components, now.weights):
            target[component.name] = float(weight)
    return moved


def update(target):
    """Draws a driven object where its properties or its empties want it."""
    now = played(target)
    if len(target.data.vertices) != len(now.out):
        raise sinew.SinewError(
            f"{target.name} has {len(target.data.vertices)} vertices and its package {len(now.out)}: load it on a mesh of its own"
        )
    weights = weights_of(target, now.components)
    if now.weights is not None and np.array_equal(weights, now.weights):
        if not drag(target, now):
            return
        now.player.frame(out=now.out)
    else:
        now.weights = weights
        now.player.frame(weights, out=now.out)
    write(target.data, now.out)


@persistent
def follow(scene, _graph=None):
    """Handler: nothing that fails here may stop Blender, and it is said once."""
    for target in scene.objects:
        if PACKAGE not in target or target.type != "MESH" or target.mode != "OBJECT":
            continue
        try:
            update(target)
            if "sinew_error" in target:
                del target["sinew_error"]
        except (sinew.SinewError, RuntimeError) as error:
            if target.get("sinew_error") != str(error):
                target["sinew_error"] = str(error)
                print(f"Sinew: {error}")


@persistent
def clear(*_):
    """Another file: other objects."""
    playing.clear()


HANDLERS = (
    (bpy.app.handlers.frame_change_post, follow),
    (bpy.app.handlers.depsgraph_update_post, follow),
    (bpy.app.handlers.load_post, clear),
)


def listen():
    for handlers, handler in HANDLERS:
        handlers.append(handler)


def forget():
    for handlers, handler in HANDLERS:
        if handler in handlers:
            handlers.remove(handler)
    playing.clear()


def drive(target, path):
    """Makes an object that a package drives, with a property for each component."""
    target[PACKAGE] = path
    playing.pop(target.name, None)
    for component in played(target).components:
        target[component.name] = 0.0
        target.id_properties_ui(component.name).update(
            min=component.minimum, max=component.maximum, soft_min=component.minimum, soft_max=component.maximum, default=0.0
        )
        target.property_overridable_library_set(f'["{component.name}"]', True)
    update(target)


class SINEW_OT_load(bpy.types.Operator):
    """Make a new object that a package drives"""

    bl_idname = "object.sinew_load"
    bl_label = "Load package"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", name="Package")
    filter_glob: StringProperty(default="*.sinew", options={"HIDDEN"})

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        name = bpy.path.display_name_from_filepath(self.filepath)
        try:
            package = sinew.load(bpy.path.abspath(self.filepath))
            mesh = bpy.data.meshes.new(name)
            mesh.from_pydata(package.rest.tolist(), [], package.faces.tolist())
            target = bpy.data.objects.new(name, mesh)
            context.collection.objects.link(target)
            drive(target, self.filepath)
        except sinew.SinewError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.view_layer.objects.active = target
        return {"FINISHED"}


class SINEW_OT_hold(bpy.types.Operator):
    """Put an empty on each selected vertex: moving it drags the mesh"""

    bl_idname = "object.sinew_hold"
    bl_label = "Hold vertices"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and PACKAGE in context.object

    def execute(self, context):
        target = context.object
        mode = target.mode
        # A selection is written to the mesh when its editing ends.
        if mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        chosen = [vertex.index for vertex in target.data.vertices if vertex.select]
        if not 0 < len(chosen) <= 16:
            self.report({"ERROR"}, f"{len(chosen)} vertices are selected: select 1 to 16 in edit mode")
            return {"CANCELLED"}
        positions = positions_of(target.data)
        for vertex in chosen:
            empty = bpy.data.objects.new(f"{target.name} {vertex}", None)
            empty.empty_display_size = 0.03 * max(target.dimensions)
            empty.parent = target
            empty.location = positions[vertex]
            empty[VERTEX] = vertex
            context.collection.objects.link(empty)
        context.view_layer.update()
        return {"FINISHED"}


CLASSES = (SINEW_OT_load, SINEW_OT_hold)
