# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of images: from where they are taken, and what they look like. stdlib only."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from generator.plan.setting import Choice, setting
from generator.plan.shading import Shading
from generator.plan.variety import CHOICES, NONE
from generator.plan.wear import Wear

PRESET_SAMPLES = {"fast": 1, "quality": 1}
"""Cycles samples a pixel of each preset, where none are asked for. One, denoised, moves landmarks less than
four that are not, in less time: benchmarks/quality.py."""

MANY_SAMPLES = 64
"""Of so many, path tracing leaves little noise, and a denoiser would take the skin's relief with it."""

Projection = Literal["perspective", "orthographic"]

NOTHING, PLAIN = "none", "plain"
"""No environment; a backdrop of one colour."""

ENVIRONMENT, NOISE, PICTURE = "environment", "noise", "picture"
"""The other backdrops."""

BACKDROPS = (PLAIN, ENVIRONMENT, NOISE, PICTURE)


@dataclass(frozen=True)
class Lens:
    """From where an image is taken."""

    variety: str = setting(
        NONE, "Distributions of the settings that you do not give, drawn for every image", choices=CHOICES,
        label="Variety", content=False,
    )  # fmt: skip

    resolution: int = setting(
        256, "Side of the square images", unit="pixels", low=16, high=4096, label="Resolution"
    )
    lens_mm: float = setting(
        85.0, "Focal length on a 36 mm sensor", unit="mm", low=10, high=1000, label="Lens", varies=True
    )
    projection: Projection = setting(
        "perspective", "How rays meet the camera",
        choices=(
            Choice("perspective", "A real camera"),
            Choice("orthographic", "Parallel rays, the scale of the lens at the pivot"),
        ),
        label="Projection",
    )  # fmt: skip
    distance_mm: float | None = setting(
        None, "Camera to the head's pivot; without it the camera stands where each head just fits",
        unit="mm", low=100, high=100_000, label="Distance", varies=True,
    )  # fmt: skip
    margin: float = setting(
        1.05, "Room around a framed head; 1 touches the border", low=0.5, high=10, label="Margin",
        varies=True,
    )  # fmt: skip
    zoom: bool = setting(
        False, "Choose the lens by which the head just fits at the distance, whatever --lens says",
        label="Zoom to fit",
    )  # fmt: skip
    aspect: float = setting(
        1.0, "Width of the images over their height; the longer side is the resolution", low=0.25, high=4,
        label="Aspect",
    )  # fmt: skip
    shift_x: float = setting(
        0.0, "How far right of the middle the head's pivot is, in widths of the image",
        low=-1, high=1, label="Shift right", varies=True,
    )  # fmt: skip
    shift_y: float = setting(
        0.0, "How far below the middle the head's pivot is, in heights of the image",
        low=-1, high=1, label="Shift down", varies=True,
    )  # fmt: skip
    scene_camera: bool = setting(
        False, "See the head of a Blender scene through the scene's own camera, from where it stands"
    )


NO_JPEG = 100.0
"""The JPEG quality at which there is none."""


@dataclass(frozen=True)
class Sensor:
    """What a camera does to the light; see :mod:`generator.picture.develop`."""

    exposure_ev: float = setting(
        0.0, "Stops that the image is lighter or darker", unit="stops", low=-6, high=6, label="Exposure",
        varies=True,
    )  # fmt: skip
    warmth: float = setting(
        0.0, "White balance: stops of red against blue", unit="stops", low=-2, high=2, label="Warmth",
        varies=True,
    )  # fmt: skip
    contrast: float = setting(
        0.0, "Tone curve: above zero steeper in the middle", low=-1, high=1, label="Contrast", varies=True
    )
    defocus_px: float = setting(
        0.0, "Radius of the disc that a point becomes", unit="pixels", low=0, high=32, label="Defocus",
        flag="--defocus", varies=True,
    )  # fmt: skip
    motion_px: float = setting(
        0.0, "Length of the streak that a point becomes", unit="pixels", low=0, high=64, label="Motion",
        flag="--motion", varies=True,
    )  # fmt: skip
    motion_deg: float = setting(
        0.0, "Direction of the streak: 0 is to the right, 90 is up", unit="degrees", low=-180, high=180,
        flag="--motion-direction", label="Direction", varies=True,
    )  # fmt: skip
    detail: float = setting(
        1.0, "Resolution of the sensor, as a share of the image's pixels along each side", low=0.05, high=1,
        label="Detail", varies=True,
    )  # fmt: skip
    noise: float = setting(
        0.0, "Standard deviation of the noise in linear light, at a middle grey of 0.18", low=0, high=0.5,
        label="Noise", varies=True,
    )  # fmt: skip
    jpeg: float = setting(
        NO_JPEG, "Quality of a JPEG that the camera makes of the image; 100 is no JPEG", low=1, high=100,
        label="JPEG quality", varies=True,
    )  # fmt: skip

    @property
    def is_plain(self) -> bool:
        """Does it leave images as they are rendered?"""
        return all(getattr(self, one.name) == one.default for one in fields(Sensor))


@dataclass(frozen=True)
class Look(Wear, Shading, Sensor):
    """What an image looks like, besides head, pose and camera. Of one image: part of a View."""

    preset: str = setting(
        "fast", "How light is computed",
        choices=(
            Choice("fast", "Light computed from the normal: no noise, quick"),
            Choice("quality", "Path traced, soft shadows; denoised below 64 samples"),
        ),
        label="Look",
    )  # fmt: skip
    samples: int | None = setting(
        None, "Cycles samples a pixel; without it those of the preset", low=1, high=4096,
        label="Samples",
    )  # fmt: skip
    light_yaw_deg: float = setting(
        25.0, "Where the key light stands, seen from the head: above zero towards image left",
        unit="degrees", low=-180, high=180, flag="--light", label="Light yaw", varies=True,
    )  # fmt: skip
    light_pitch_deg: float = setting(
        35.0, "Height of the key light, seen from the head",
        unit="degrees", low=-90, high=90, flag="--light", label="Light pitch", varies=True,
    )  # fmt: skip
    ambient: float = setting(
        0.35, "Share of the light that comes from all sides", low=0, high=1, label="Ambient", varies=True
    )
    background: tuple[float, float, float] = setting(
        (0.5, 0.5, 0.5), "Colour behind the head: R,G,B in sRGB, between 0 and 1", low=0, high=1,
        label="Background", varies=True, since="1.3.0",
    )  # fmt: skip
    environment: str = setting(
        NOTHING, "High-dynamic-range panorama that lights the head, by its name: one of Blender's, or of "
        "--environments; all draws from every one",
        label="Environment", varies=True,
    )  # fmt: skip
    environment_yaw_deg: float = setting(
        0.0, "How far the environment is turned; at 0 its middle is behind the head, above zero it moves to "
        "image right",
        unit="degrees", low=-180, high=180, flag="--environment-yaw", label="Environment yaw", varies=True,
    )  # fmt: skip
    environment_strength: float = setting(
        1.0, "Strength of the environment; at 1 a face towards the camera has its own colours",
        low=0, high=100, label="Environment strength", varies=True,
    )  # fmt: skip
    environment_key: float = setting(
        0.0, "Strength of the key light beside an environment; without an environment it has what ambient "
        "leaves",
        low=0, high=10, label="Key beside it", varies=True,
    )  # fmt: skip
    backdrop: str = setting(
        PLAIN, "Picture behind the head: plain, the colour of --background; environment, as the camera sees "
        "it; noise, smooth random colours; picture, one of --pictures",
        label="Backdrop", varies=True,
    )  # fmt: skip
    backdrop_picture: str = setting(
        "",
        "Which of --pictures is behind the head, by its name; without it one is drawn from all",
        varies=True,
    )

    @property
    def cycles_samples(self) -> int:
        """Samples a pixel: those asked for, or the preset's."""
        return self.samples or PRESET_SAMPLES[self.preset]


def is_denoised(look: Look) -> bool:
    """Is noise of path tracing taken out of the images of a look? Their alpha is left as it was sampled."""
    return look.preset == "quality" and look.cycles_samples < MANY_SAMPLES


@dataclass(frozen=True)
class Files:
    """Where the files of environments and backdrops are."""

    environments: str | None = setting(
        None, "Folder of panoramas, .exr or .hdr; without it those of Blender", content=False,
        path=True,
    )  # fmt: skip
    pictures: str | None = setting(
        None, "Folder of pictures, .png or .jpg, for backdrops", content=False, path=True
    )
    things: str | None = setting(
        None, "Folder of things of your own that heads may wear: .obj, .ply or .glb, a .json beside each",
        content=False, path=True,
    )  # fmt: skip
    files_sha256: str = setting(
        "", "SHA-256 of the names and bytes of the files that are used; a build computes it", flag=""
    )


@dataclass(frozen=True)
class Render(Files, Look, Lens):
    """How images are made: the lens they are seen through, and their look."""

    @property
    def look(self) -> Look:
        """The look alone."""
        return Look(**{f.name: getattr(self, f.name) for f in fields(Look)})
