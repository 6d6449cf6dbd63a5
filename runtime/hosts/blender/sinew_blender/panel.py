"""The panel in the sidebar: operators, and the components as a tree of sliders."""

import bpy
import sinew

from .play import PACKAGE, played


class SINEW_PT_panel(bpy.types.Panel):
    bl_label = "Sinew"
    bl_idname = "SINEW_PT_panel"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sinew"

    def draw(self, context):
        layout, target = self.layout, context.object
        layout.operator("object.sinew_learn")
        layout.operator("object.sinew_load")
        if target is None or PACKAGE not in target:
            return
        layout.operator("object.sinew_hold")
        layout.operator("object.sinew_shape_keys")
        if "sinew_error" in target:
            layout.label(text=target["sinew_error"], icon="ERROR")
        try:
            components = played(target).components
        except sinew.SinewError as error:
            layout.label(text=str(error), icon="ERROR")
            return
        below = {}
        for component in components:
            below.setdefault(component.parent, []).append(component)
        indices = {component.name: index for index, component in enumerate(components)}

        def tree(parent, column):
            for component in below.get(parent, []):
                column.prop(target, f'["{component.name}"]', text=component.name)
                if indices[component.name] in below:
                    row = column.row()
                    row.separator(factor=2)
                    tree(indices[component.name], row.column(align=True))

        tree(None, layout.column(align=True))


CLASSES = (SINEW_PT_panel,)
