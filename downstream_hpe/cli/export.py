# SPDX-License-Identifier: MIT
"""What ``downstream-hpe export`` does with its options."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.cli.console import JsonFlag, say
from downstream_hpe.errors import UsageError


def export(
    model: Annotated[Path, typer.Argument(help="A model folder of downstream-hpe fit.")],
    onnx: Annotated[Path | None, typer.Option(help="The graph from raw landmarks to pose.")] = None,
    weights: Annotated[Path | None, typer.Option(help="The network's weights, safetensors.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Write a trained model as files that need nothing of this program."""
    from downstream_hpe.networks.export import export_onnx
    from downstream_hpe.networks.weights import NETWORK_FILE, Weights

    if onnx is None and weights is None:
        raise UsageError("nothing to write; give --onnx FILE, --weights FILE or both")
    trained = Weights.load(model / NETWORK_FILE)
    written: list[Path] = []
    for path, write in ((onnx, lambda file: export_onnx(trained, file)), (weights, trained.save)):
        if path is not None:
            write(path)
            written.append(path)
    if as_json:
        typer.echo(json.dumps([{"file": str(path), "bytes": path.stat().st_size} for path in written]))
        return
    for path in written:
        say(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
