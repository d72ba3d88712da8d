# SPDX-License-Identifier: MIT
"""Learn head-pose manifolds from Headturn's Parquet tables and estimate pose from landmarks.

The method is NLML-HPE (Ghafourian and Sukno): Tucker decomposition, cosine manifolds, an encoder
and three MLP heads. Angles are degrees in the order (yaw, pitch, roll); the rotation is R_C.

Dependence points one way (tests/downstream_hpe/test_rooms.py holds it):

    cli -> fitting -> {evaluation, networks} -> {prediction, manifold, tables} -> geometry

What most programs want is here by name, and read from its room when it is first asked for.
"""

# Nothing is imported here, not even of __future__: whoever typed python -m downstream_hpe.cli has the current
# folder as the first place of modules until that command says otherwise.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from downstream_hpe.errors import HpeError
    from downstream_hpe.prediction.predictor import Pose, Predictor
    from downstream_hpe.tables.rows import Rows, read_rows
    from downstream_hpe.tables.tensor import open_tensor

__all__ = ["HpeError", "Pose", "Predictor", "Rows", "open_tensor", "read_rows"]

_HOMES = {
    "HpeError": "errors",
    "Pose": "prediction.predictor",
    "Predictor": "prediction.predictor",
    "Rows": "tables.rows",
    "open_tensor": "tables.tensor",
    "read_rows": "tables.rows",
}


def __getattr__(name: str) -> "Any":
    import importlib

    # PEP 562: importing the package must not cost what a part of it needs.
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
