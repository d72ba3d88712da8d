# SPDX-License-Identifier: GPL-3.0-or-later
"""The folders of images that the published code of NLML-HPE reads."""

from __future__ import annotations

from pathlib import Path

from generator.dataset.export.numbered import head_numbers, write_identities
from generator.dataset.export.options import Format
from generator.dataset.export.source import Source, require_images
from generator.errors import UsageError

ABOUT = """\
`<split>/<id>/ID<id>_(<yaw>_<pitch>_<roll>).{suffix}`, whole degrees, as the published code of NLML-HPE looks
for them: a folder a split, with images alone in it, since that code takes every name in it for the number of
a head. Give `train` to `trainset_path` and `validation` to `valset_path`. `identities.csv` says which head
each id is: the subject's own number where all subjects are numbers (122, facescape-122) with one expression
each, else counted from 1.

The pose in a name is R_C = Rx(-pitch) Ry(yaw) Rz(roll) in the camera frame. There are no landmarks here:
the code runs its own detector, so an image on which ours found no face has an exact label all the same.
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it.

    Raises UsageError: a pose is not in whole degrees. DatasetError: there are no images.
    """
    require_images(source, "nlml-hpe")
    assert source.image_format is not None
    numbers = head_numbers(source.heads, keep_numbers=True)
    for sample in source.samples():
        angles = sample.angles_deg.tolist()
        if any(angle != int(angle) for angle in angles):
            raise UsageError(
                f"{source.root}: the pose of {sample.sample_id} is not in whole degrees, and nlml-hpe names "
                "its files by whole degrees; build over a grid of whole degrees, or take another format"
            )
        number = numbers[sample.head]
        yaw, pitch, roll = (int(angle) for angle in angles)
        name = f"ID{number}_({yaw}_{pitch}_{roll}).{source.image_format}"
        path = folder / sample.split / str(number) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(sample.encoded(source.image_format))
    write_identities(source.heads, numbers, folder)
    return ABOUT.format(suffix=source.image_format)


FORMAT = Format(
    write,
    readers="the published code of NLML-HPE",
    holds="`<split>/<id>/ID<id>_(<yaw>_<pitch>_<roll>).jpg` or `.png`",
    written="(yaw, pitch, roll) in the file name, whole degrees",
    back="Rx(-pitch) Ry(yaw) Rz(roll)",
    image_formats=("jpg", "png"),
)
