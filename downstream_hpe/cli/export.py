# SPDX-License-Identifier: MIT
"""What ``downstream-hpe export`` does with its options."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.cli.console import JsonFlag, say
from downstream_hpe.errors import UsageError
from downstream_hpe.writing import writing


def export(
    model: Annotated[
        str,
        typer.Argument(help="A model that comes along, such as headturn, or a folder of downstream-hpe fit."),
    ],
    onnx: Annotated[
        Path | None,
        typer.Option(
            help="The graph from raw landmarks to pose; for a model that comes along, also its card, FILE.md."
        ),
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(help="The network's weights, safetensors; for a folder of fit.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Write a trained model as files that need nothing of this program."""
    from downstream_hpe.prediction.predictor import shipped_models

    if onnx is None and weights is None:
        raise UsageError("nothing to write; give --onnx FILE, --weights FILE or both")
    if model in shipped_models():
        written = _shipped(model, onnx, weights)
    else:
        written = _trained(Path(model), onnx, weights)
    if as_json:
        typer.echo(json.dumps([{"file": str(path), "bytes": path.stat().st_size} for path in written]))
        return
    for path in written:
        say(f"{path}: {path.stat().st_size / 1e3:,.0f} kB")


def _shipped(name: str, onnx: Path | None, weights: Path | None) -> list[Path]:
    """The file as it is, and beside it what it was made from, what it is bad at, and its licence."""
    from downstream_hpe.prediction.predictor import MODELS

    if onnx is None or weights is not None:
        raise UsageError(f"--weights: {name} comes along as ONNX alone; give --onnx FILE")
    copies = {onnx: MODELS / f"{name}.onnx", onnx.with_name(f"{onnx.name}.md"): MODELS / f"{name}.md"}
    for copy, original in copies.items():
        with writing(copy):
            copy.write_bytes(original.read_bytes())
    return list(copies)


def _trained(folder: Path, onnx: Path | None, weights: Path | None) -> list[Path]:
    from downstream_hpe.networks.export import export_onnx
    from downstream_hpe.networks.weights import NETWORK_FILE, Weights

    trained = Weights.load(folder / NETWORK_FILE)
    written: list[Path] = []
    for path, write in ((onnx, lambda file: export_onnx(trained, file)), (weights, trained.save)):
        if path is not None:
            with writing(path):
                write(path)
            written.append(path)
    return written
