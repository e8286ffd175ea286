"""Loads a drape with its motion into Blender: blender --python docs/blender.py -- OUT

Every OBJ of the folder comes in with its materials; its point cache moves it. For an editor without a command line, set FOLDER.
"""
import pathlib
import sys

import bpy

FOLDER = sys.argv[sys.argv.index("--") + 1] if "--" in sys.argv else "out"

for path in sorted(pathlib.Path(FOLDER).resolve().glob("*.obj")):
    bpy.ops.wm.obj_import(filepath=str(path), validate_meshes=False)
    mesh = bpy.context.selected_objects[0]
    mesh.name = path.stem
    cache = path.with_suffix(".pc2")
    if cache.exists():
        modifier = mesh.modifiers.new("motion", "MESH_CACHE")
        modifier.cache_format = "PC2"
        modifier.filepath = str(cache)
        # The vertices are in the file's own axes, as those of the imported mesh are: the object turns both.
        modifier.forward_axis, modifier.up_axis = "POS_Y", "POS_Z"
        frames = (cache.stat().st_size - 32) // (12 * len(mesh.data.vertices))
        bpy.context.scene.frame_end = max(bpy.context.scene.frame_end, frames - 1)
bpy.context.scene.frame_start = 0
