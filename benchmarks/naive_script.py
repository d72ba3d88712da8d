# SPDX-License-Identifier: GPL-3.0-or-later
"""The baseline: what a first script with bpy and mediapipe looks like.

    python benchmarks/naive_script.py HEAD.obj FRAMES

One process, Blender's own importer, Principled materials, 16 samples and the
denoiser, PNG files, then MediaPipe over the files. Prints images a second.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from pathlib import Path

import bpy
import cv2
from mathutils import Euler

from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh


def main(mesh: str, frames: int) -> None:
    """Render and detect; the last word printed is the rate."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=mesh)
    head = bpy.context.selected_objects[0]
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = True
    scene.render.resolution_x = scene.render.resolution_y = 256
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.lens = 85
    size = max(head.dimensions)
    camera.location = (0, -2.6 * size, 0)
    camera.rotation_euler = (math.pi / 2, 0, 0)
    camera.data.clip_end = 100 * size
    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "SUN"))
    lamp.data.energy = 3
    lamp.rotation_euler = (math.radians(50), 0, math.radians(-25))
    for thing in (camera, lamp):
        scene.collection.objects.link(thing)
    scene.camera = camera
    head.rotation_mode = "XYZ"
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        for frame in range(frames):
            share = frame / max(frames - 1, 1)
            head.rotation_euler = Euler((math.pi / 2 + share - 0.5, 0, 1.6 * share - 0.8))
            scene.render.filepath = f"{folder}/{frame:04d}.png"
            bpy.ops.render.render(write_still=True)
        detector = MediaPipeFaceMesh()
        for path in sorted(Path(folder).glob("*.png")):
            detector.detect(cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB))
        print(frames / (time.perf_counter() - start))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
