# SPDX-License-Identifier: GPL-3.0-or-later
"""Tar files that are read from front to back: WebDataset."""

from __future__ import annotations

import json
import tarfile
from pathlib import Path
from typing import BinaryIO

from generator.dataset.export.options import Format
from generator.dataset.export.record import RECORD_ABOUT, Records
from generator.dataset.export.shards import Shards
from generator.dataset.export.source import Source, require_images

ABOUT = f"""\
A row is two members of a tar file, `NNNNNNNN.png` or `.jpg` and `NNNNNNNN.json`, so that the key of a sample
is its number.

{{shards}}

```python
import webdataset as wds
rows = wds.WebDataset("TARGET/train-000000.tar", shardshuffle=False)
rows = rows.decode("rgb8").to_tuple("png;jpg", "json")
```

Rows stand head by head: shuffle over more rows than a head has poses.

{RECORD_ABOUT}"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it.

    Raises UsageError: a row has no landmarks and missing = "fail". DatasetError: there are no images.
    """
    require_images(source, "webdataset")
    records = Records(source)
    with Shards(folder, ".tar", _end) as shards:
        for number, sample in enumerate(source.samples(), start=1):
            file = shards.file(sample.split)
            _member(file, f"{number:08d}{sample.image_suffix}", sample.image)
            _member(file, f"{number:08d}.json", json.dumps(records.of(sample)).encode())
        return ABOUT.format(shards=shards.table())


def _member(file: BinaryIO, name: str, content: bytes) -> None:
    """One member without owner or time, so that two exports are the same bytes."""
    info = tarfile.TarInfo(name)
    info.size = len(content)
    file.write(info.tobuf(tarfile.USTAR_FORMAT))
    file.write(content + bytes(-len(content) % tarfile.BLOCKSIZE))


def _end(file: BinaryIO) -> None:
    file.write(bytes(2 * tarfile.BLOCKSIZE))


FORMAT = Format(
    write,
    readers="webdataset, in torch and elsewhere",
    holds="`<split>-NNNNNN.tar`: an image and a JSON a row",
    written="`rotation`, nine numbers",
    back="as it stands",
    missing=("keep", "skip", "fail", "exact"),
    landmarks=True,
    boxes=True,
)
