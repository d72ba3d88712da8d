# SPDX-License-Identifier: GPL-3.0-or-later
"""TFRecord files of tf.train.Example, written without TensorFlow.

Sources: "TFRecords format details" of tensorflow.org (length, masked CRC-32C, data, masked CRC-32C); messages
Example, Features, Feature, BytesList, FloatList, Int64List of tensorflow/core/example; the protobuf encoding.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.export.crc32c import crc32c
from generator.dataset.export.options import Format
from generator.dataset.export.record import RECORD_ABOUT, Records
from generator.dataset.export.shards import Shards
from generator.dataset.export.source import Source, require_images

_VARINT, _BYTES = 0, 2
_BYTES_LIST, _FLOAT_LIST, _INT64_LIST = 1, 2, 3
"""Fields of a Feature."""

ABOUT = f"""\
A record is a `tf.train.Example`. Its feature `image` is the encoded file, PNG or JPEG as `image_format` says;
the others are those below. Texts are bytes in UTF-8, flags and counts int64, and other numbers float32, since
an Example has no float64: `rotation` is right to 1e-7.

{{shards}}

```python
files = tf.data.Dataset.list_files("TARGET/train-*.tfrecord")
rows = files.interleave(tf.data.TFRecordDataset).map(lambda one: tf.io.parse_single_example(one, {{{{
    "image": tf.io.FixedLenFeature([], tf.string), "rotation": tf.io.FixedLenFeature([9], tf.float32)}}}}))
```

Rows stand head by head: shuffle over more rows than a head has poses.

{RECORD_ABOUT}"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it.

    Raises UsageError: a row has no landmarks and missing = "fail". DatasetError: there are no images.
    """
    require_images(source, "tfrecord")
    records = Records(source)
    with Shards(folder, ".tfrecord") as shards:
        for sample in source.samples():
            image = {"image": sample.image, "image_format": sample.image_suffix.removeprefix(".")}
            shards.file(sample.split).write(framed(example({**image, **records.of(sample)})))
        return ABOUT.format(shards=shards.table())


def framed(data: bytes) -> bytes:
    """One record of a TFRecord file."""
    length = struct.pack("<Q", len(data))
    return length + _masked(length) + data + _masked(data)


def example(features: Mapping[str, Any]) -> bytes:
    """A tf.train.Example of bytes, text, flags, numbers, and flat lists of numbers."""
    entries = (_message(1, _message(1, name.encode()) + _message(2, _feature(value))) for name, value in
               features.items())  # fmt: skip
    return _message(1, b"".join(entries))


def _feature(value: Any) -> bytes:
    if isinstance(value, str | bytes):
        data = value.encode() if isinstance(value, str) else value
        return _message(_BYTES_LIST, _message(1, data))
    values = value if isinstance(value, list) else [value]
    if all(isinstance(one, int) for one in values):  # bool is one
        return _message(_INT64_LIST, _message(1, b"".join(map(_varint, values))))
    return _message(_FLOAT_LIST, _message(1, np.array(values, dtype="<f4").tobytes()))


def _message(field: int, data: bytes) -> bytes:
    return bytes([field << 3 | _BYTES]) + _varint(len(data)) + data


def _varint(value: int) -> bytes:
    value = int(value) & 0xFFFFFFFFFFFFFFFF
    groups = []
    while value > 0x7F:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*groups, value])


def _masked(data: bytes) -> bytes:
    crc = crc32c(data)
    return struct.pack("<I", ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF)


FORMAT = Format(
    write,
    readers="tf.data, and others that read TFRecord",
    holds="`<split>-NNNNNN.tfrecord`: a tf.train.Example a row",
    written="`rotation`, nine numbers, float32",
    back="as it stands, to 1e-7",
    missing=("keep", "skip", "fail", "exact"),
    landmarks=True,
    boxes=True,
)
