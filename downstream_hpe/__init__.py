# SPDX-License-Identifier: MIT
"""Learn head-pose manifolds from Headturn's Parquet tables and estimate pose from landmarks.

The method is NLML-HPE (Ghafourian and Sukno): Tucker decomposition, cosine manifolds, an encoder
and three MLP heads. Angles are degrees in the order (yaw, pitch, roll); the rotation is R_C.

Dependence points one way (tests/downstream_hpe/test_rooms.py holds it):

    cli -> fitting -> {evaluation, networks} -> {prediction, manifold, tables} -> geometry

What most programs want is here by name, and read from its room when it is first asked for:

    from downstream_hpe import Predictor, draw

    predictor = Predictor()
    pose = predictor.predict("photo.jpg")
    draw("photo.jpg", pose).save("drawn.png")
"""

# Nothing is imported here, not even of __future__: whoever typed python -m downstream_hpe.cli has the current
# folder as the first place of modules until that command says otherwise.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from downstream_hpe.errors import HpeError
    from downstream_hpe.geometry.camera import Camera
    from downstream_hpe.networks.pose_images import PoseImages
    from downstream_hpe.prediction.drawing import draw
    from downstream_hpe.prediction.pose import Pose
    from downstream_hpe.prediction.predictor import Predictor
    from downstream_hpe.release import __version__
    from downstream_hpe.tables.rows import Rows, read_rows
    from downstream_hpe.tables.tensor import open_tensor

__all__ = [
    "Camera",
    "HpeError",
    "Pose",
    "PoseImages",
    "Predictor",
    "Rows",
    "__version__",
    "draw",
    "open_tensor",
    "read_rows",
]

_HOMES = {
    "Camera": "geometry.camera",
    "HpeError": "errors",
    "Pose": "prediction.pose",
    "PoseImages": "networks.pose_images",
    "Predictor": "prediction.predictor",
    "Rows": "tables.rows",
    "__version__": "release",
    "draw": "prediction.drawing",
    "open_tensor": "tables.tensor",
    "read_rows": "tables.rows",
}

if not TYPE_CHECKING:  # to whom every name would be one of these

    def __getattr__(name: str):
        import importlib

        # PEP 562: importing the package must not cost what a part of it needs.
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
