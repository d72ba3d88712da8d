# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``headturn`` command.

Exit codes: 0 done, 1 failed, 2 wrong use, 3 finished but something was left out.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from generator import __version__
from generator.cli import blender as cli_blender
from generator.cli import build as cli_build
from generator.cli import export as cli_export
from generator.cli import option_values
from generator.cli import replay as cli_replay
from generator.cli.console import JsonFlag, err, out
from generator.cli.heads import heads_app
from generator.cli.option_values import given, numbers, pose_source
from generator.cli.reporter import TerminalReporter
from generator.errors import HeadturnError, UsageError
from generator.execution.stopping import Stopped

app = typer.Typer(
    help="3D heads in, Parquet with exact head pose out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.add_typer(heads_app, name="heads")


class Preset(str, Enum):
    """Looks of --preset."""

    fast = "fast"
    quality = "quality"


class ExecutorName(str, Enum):
    """Choices of --executor."""

    serial = "serial"
    local = "local"
    ray = "ray"


BlenderOption = Annotated[
    str | None,
    typer.Option("--blender", help="A Blender executable (4.2 or newer) instead of the bpy wheel."),
]
UnitsOption = Annotated[
    str | None, typer.Option(help="Unit of the meshes: um, mm, cm, dm or m. Guessed if absent.")
]
UpOption = Annotated[str | None, typer.Option(help="Axis of the crown, such as +Y. Guessed if absent.")]
ForwardOption = Annotated[str | None, typer.Option(help="Axis of the nose, such as +Z. Guessed if absent.")]


def _version(value: bool) -> None:
    if value:
        out.print(f"headturn {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """3D heads in, Parquet with exact head pose out."""


@app.command(epilog="Example: headturn build --heads my_heads --yaw -50,50,10 --preset quality --out dataset")
def build(
    config_file: Annotated[
        Path | None, typer.Argument(metavar="[CONFIG.toml]", help="Configuration; flags override it.")
    ] = None,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the dataset.")] = Path("dataset"),
    heads: Annotated[
        str | None, typer.Option(help='A head source, or "parametric" (the default: made on the spot).')
    ] = None,
    count: Annotated[int | None, typer.Option(help="Parametric heads to make.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of heads and random poses.")] = None,
    subject: Annotated[list[str] | None, typer.Option(help="Only this subject; repeatable.")] = None,
    expression: Annotated[list[str] | None, typer.Option(help="Only this expression; repeatable.")] = None,
    sampled_expressions: Annotated[
        int | None, typer.Option(help="Sampled expressions a parametric head.")
    ] = None,
    license_: Annotated[
        str | None, typer.Option("--license", help="Licence of heads that do not say.")
    ] = None,
    redistributable: Annotated[
        bool | None, typer.Option("--redistributable/--not-redistributable", help="May renders be published?")
    ] = None,
    units: UnitsOption = None,
    up: UpOption = None,
    forward: ForwardOption = None,
    poses: Annotated[str | None, typer.Option(help="grid, uniform:N, sobol:N, or a CSV file.")] = None,
    yaw: Annotated[str | None, typer.Option(help="START,STOP,STEP of the grid, or LOW,HIGH.")] = None,
    pitch: Annotated[str | None, typer.Option(help="As --yaw.")] = None,
    roll: Annotated[str | None, typer.Option(help="As --yaw.")] = None,
    frame: Annotated[
        str | None, typer.Option(help="Pose zero: source (the mesh's axes) or canonical (levelled).")
    ] = None,
    preset: Annotated[
        Preset | None, typer.Option(help="fast: no noise, quick. quality: path traced.")
    ] = None,
    samples: Annotated[int | None, typer.Option(help="Cycles samples a pixel.")] = None,
    resolution: Annotated[int | None, typer.Option(help="Image side in pixels.")] = None,
    lens: Annotated[float | None, typer.Option(help="Focal length in mm on a 36 mm sensor.")] = None,
    projection: Annotated[str | None, typer.Option(help="perspective or orthographic.")] = None,
    distance: Annotated[
        float | None, typer.Option(help="Camera to head in mm; without it every head is framed.")
    ] = None,
    light: Annotated[str | None, typer.Option(help="YAW,PITCH of the key light in degrees.")] = None,
    background: Annotated[str | None, typer.Option(help="R,G,B between 0 and 1 (sRGB).")] = None,
    images: Annotated[str | None, typer.Option(help="files, embedded or none.")] = None,
    image_format: Annotated[str | None, typer.Option(help="png or jpg.")] = None,
    passes: Annotated[
        str | None, typer.Option(help="OpenEXR passes: depth,normal,position,uv,object_index.")
    ] = None,
    validation: Annotated[float | None, typer.Option(help="Share of subjects for validation, 0-1.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Lanes; default one a core.")] = None,
    executor: Annotated[
        ExecutorName, typer.Option(help="local, ray for a cluster, or serial for debugging.")
    ] = ExecutorName.local,
    address: Annotated[
        str | None, typer.Option(help="Ray cluster, such as auto; without it Ray runs here alone.")
    ] = None,
    deadline: Annotated[
        float, typer.Option(min=1, help="Seconds of silence after which a worker is replaced.")
    ] = 300.0,
    memory: Annotated[
        float | None, typer.Option(min=0, help="MiB a lane may grow to; default 80 % of the machine for all.")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Delete the dataset that is there first.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before deleting.")] = False,
    blender: BlenderOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Render every head at every pose, find the landmarks, write the tables.

    Run it again to continue a build that was interrupted, or with more heads or
    poses to extend it.
    """
    from generator.plan.config import load_config

    overrides = given(
        heads={
            "source": heads,
            "count": count,
            "seed": seed,
            "sampled_expressions": sampled_expressions,
            "subjects": subject or None,
            "expressions": expression or None,
            "license": license_,
            "redistributable": redistributable,
            "units": units,
            "up": up,
            "forward": forward,
        },
        poses={
            **pose_source(poses),
            "frame": frame,
            "seed": seed,
            "yaw": numbers("--yaw", yaw),
            "pitch": numbers("--pitch", pitch),
            "roll": numbers("--roll", roll),
        },
        render={
            "preset": preset.value if preset else None,
            "samples": samples,
            "resolution": resolution,
            "lens_mm": lens,
            "projection": projection,
            "distance_mm": distance,
            **option_values.light(light),
            "background": numbers("--background", background),
        },
        dataset={
            "images": images,
            "image_format": image_format,
            "passes": passes.split(",") if passes is not None else None,
            "validation": validation,
        },
    )
    config = load_config(config_file, overrides)
    cli_build.run(
        config,
        folder,
        fresh=fresh,
        yes=yes,
        as_json=as_json,
        executor={
            "name": executor.value,
            "workers": workers,
            "blender": blender,
            "min_confidence": config.landmarks.min_confidence,
            "deadline_s": deadline,
            "memory_mib": memory,
            "address": address,
        },
    )


@app.command(epilog="Example: headturn verify dataset")
def verify(
    folder: Annotated[Path, typer.Argument(help="A dataset made by headturn build.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Sizes, footers and row counts only; contents are not read.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; default one a core where it pays.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Prove that every row of the plan is there once, labels agree and hashes match."""
    from generator.dataset.proof.verify import verify_dataset

    with TerminalReporter(err) as reporter:

        def step(done: int, total: int) -> None:
            if done == 1 and err.is_terminal:
                reporter.stage("verifying", total)
            reporter.advance()

        report = verify_dataset(folder, quick=quick, workers=workers, progress=step)
    typer.echo(json.dumps(report.as_dict(), indent=1) if as_json else report.text())
    if not report.ok:
        raise typer.Exit(1)


@app.command(epilog="Example: headturn preview heads/p0003/neutral.obj --pose 30,10,0 --out p.png")
def preview(
    head: Annotated[Path, typer.Argument(help="A mesh file, or a folder that holds one subject.")],
    pose: Annotated[str, typer.Option(help="YAW,PITCH,ROLL in degrees.")] = "0,0,0",
    picture: Annotated[Path, typer.Option("--out", help="The picture, .png or .jpg.")] = Path("preview.png"),
    expression: Annotated[str | None, typer.Option(help="Which expression; default neutral.")] = None,
    preset: Annotated[Preset, typer.Option(help="fast or quality.")] = Preset.quality,
    resolution: Annotated[int, typer.Option(min=16, max=4096, help="Image side in pixels.")] = 512,
    lens: Annotated[float, typer.Option(help="Focal length in mm.")] = 85.0,
    samples: Annotated[int | None, typer.Option(min=1, help="Cycles samples a pixel.")] = None,
    landmarks: Annotated[bool, typer.Option(help="Draw the landmarks found.")] = True,
    units: UnitsOption = None,
    up: UpOption = None,
    forward: ForwardOption = None,
    blender: BlenderOption = None,
) -> None:
    """Render one head at one pose, with the landmarks drawn."""
    from generator.execution.preview.picture import render_preview
    from generator.plan.config import load_config

    angles = numbers("--pose", pose) or []
    if len(angles) != 3:
        raise UsageError(f"--pose {pose!r}: expected YAW,PITCH,ROLL in degrees, such as 30,10,0")
    overrides = given(
        heads={"source": str(head), "units": units, "up": up, "forward": forward},
        render={"preset": preset.value, "resolution": resolution, "lens_mm": lens, "samples": samples},
    )
    found = render_preview(
        load_config(None, overrides),
        (angles[0], angles[1], angles[2]),
        picture,
        expression=expression,
        draw_landmarks=landmarks,
        blender=blender,
    )
    out.print(f"{picture}: {found}", highlight=False, soft_wrap=True)


cli_build.register(app)
cli_export.register(app)
cli_blender.register(app)
cli_replay.register(app)


@contextmanager
def _one_line_errors() -> Iterator[None]:
    try:
        yield
    except HeadturnError as error:
        err.print(f"headturn: {error}", style="red", highlight=False, markup=False, soft_wrap=True)
        sys.exit(error.exit_code)
    except Stopped as stopped:
        err.print(f"headturn: {stopped}; run the same command again to continue", soft_wrap=True)
        sys.exit(stopped.exit_code)


def main() -> None:
    """Entry point of the console script."""
    with _one_line_errors():
        app()
