"""Renders a frame of a run by Cycles: the guide's recipe for Blender as a script.

tetpbd run --scene bunny --export pc2 --out FOLDER
blender --background --python docs/blender.py -- FOLDER FRAME PICTURE.png    FRAME: from 0, as exported

Blender 3.3 or later; without a GPU a minute or two. docs/figures/blender.jpg is frame 8 of that run.
"""
import math
import pathlib
import sys

import bpy

folder, frame, picture = sys.argv[sys.argv.index("--") + 1:]
folder = pathlib.Path(folder).resolve()
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene

bpy.ops.wm.obj_import(filepath=str(folder / "surface.obj"))
body = bpy.context.selected_objects[0]
cache = body.modifiers.new("tetpbd", "MESH_CACHE")
cache.cache_format, cache.filepath = "PC2", str(folder / "surface.pc2")
cache.frame_start = 0
for face in body.data.polygons:
    face.use_smooth = True


def material(name, colour, roughness, subsurface=0.0):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = roughness
    if subsurface:
        shader.inputs["Subsurface"].default_value = subsurface
        shader.inputs["Subsurface Color"].default_value = (*colour, 1)
        shader.inputs["Subsurface Radius"].default_value = (0.08, 0.03, 0.02)
    return made


body.data.materials.clear()
body.data.materials.append(material("jelly", (0.8, 0.22, 0.12), 0.25, 0.6))
bpy.ops.mesh.primitive_plane_add(size=40)
bpy.context.object.data.materials.append(material("ground", (0.55, 0.57, 0.6), 0.7))

bpy.ops.object.light_add(type="AREA", location=(-2.2, -2.2, 3.2))
lamp = bpy.context.object
lamp.data.energy, lamp.data.size = 220, 2
lamp.rotation_euler = (math.radians(42), 0, math.radians(-45))
scene.world = bpy.data.worlds.new("sky")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.62, 0.7, 0.8, 1)
scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.5

bpy.ops.object.camera_add(location=(1.5, -2.4, 1.05))
scene.camera = bpy.context.object
aim = scene.camera.constraints.new("TRACK_TO")
target = bpy.data.objects.new("target", None)
target.location = (0, 0, 0.32)
scene.collection.objects.link(target)
aim.target = target
scene.camera.data.lens = 42

scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising = 300, False  # Debian has no OpenImageDenoise
scene.render.resolution_x, scene.render.resolution_y = 720, 480
scene.view_settings.view_transform = "Filmic"
scene.frame_set(int(frame))
scene.render.filepath = str(pathlib.Path(picture).resolve())
bpy.ops.render.render(write_still=True)
