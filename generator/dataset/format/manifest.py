# SPDX-License-Identifier: GPL-3.0-or-later
"""manifest.json: written last, so a dataset that has one is finished."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Any, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from generator.dataset.format.anchors_table import ANCHORS_FILE, ANCHORS_SINCE
from generator.dataset.format.columns import IMAGE_MODES, SCHEMA_VERSION, ImageMode
from generator.dataset.format.digest import add_digests
from generator.dataset.format.files import file_sha256, one_line, write_bytes
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import HEADS_FILE
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import check_schema_version, is_newer
from generator.errors import DatasetError
from generator.escape import printable
from generator.names import as_name
from generator.plan.factors import part_folder
from generator.plan.first_settings import common_values
from generator.plan.pose_plans import POSES_FILE
from generator.reading import MAX_STATE_BYTES, parse_json, read_limited
from generator.sealed import SEAL, seal_of, sealed

MANIFEST_FILE = "manifest.json"
CONFIG_FILE, FAILURES_FILE = "config.toml", "failures.jsonl"
_PART_PATH = re.compile(r"data/[\w+-][\w .+-]*/part-[\w .+-]+\.parquet")
_TWINS_PATH = re.compile(_PART_PATH.pattern.replace("data", part_folder("any"), 1))
_HASH = r"^[0-9a-f]{64}$"


@dataclass(frozen=True)
class Manifest:
    """What a finished dataset consists of.

    versions: name and version of every package that decided the content, with "headturn".
    configuration: everything that decides the content, as plain JSON values.
    parts: sorted by path. images: see :data:`generator.dataset.format.schema.ImageMode`.
    heads, skipped, failures: how many heads it has, which were left out and
        why, and how many units failed and are recorded in failures.jsonl.
    created_by: the command line, for people; the only field that may differ
        between two builds of the same configuration.
    tables: SHA-256 of the files of :func:`side_tables`; :func:`write_manifest` fills it in.
    files: SHA-256 of config.toml and failures.jsonl, where they are there; filled in likewise.
        None in a manifest of the first release, which covered none.
    twins: the parts of twins of rows, which are no rows: neither counted nor digested with them.
    others: values of a later schema that we do not know, kept as they are.
    """

    versions: dict[str, str]
    configuration: dict[str, Any]
    parts: tuple[PartInfo, ...]
    images: ImageMode
    heads: int
    skipped: tuple[dict[str, str], ...] = ()
    failures: int = 0
    created_by: str = ""
    tables: dict[str, str] = field(default_factory=dict)
    files: dict[str, str] | None = None
    schema_version: str = SCHEMA_VERSION
    twins: tuple[PartInfo, ...] = ()
    others: dict[str, Any] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Rows of all parts."""
        return sum(part.rows for part in self.parts)

    @property
    def detected_rows(self) -> int:
        """Rows with a face found."""
        return sum(part.detected for part in self.parts)

    @property
    def digest(self) -> str:
        """Digest of the dataset's content, see :mod:`generator.dataset.format.digest`."""
        return add_digests(part.digest for part in self.parts)

    @property
    def twins_digest(self) -> str:
        """The same of the twins."""
        return add_digests(part.digest for part in self.twins)

    @property
    def splits(self) -> list[str]:
        """Names of the splits that have parts."""
        return sorted({part.path.split("/")[1] for part in self.parts})

    def as_dict(self) -> dict[str, Any]:
        """The values of manifest.json, in its order."""
        return {
            "schema_version": self.schema_version,
            "digest": self.digest,
            "rows": self.rows,
            "detected_rows": self.detected_rows,
            "heads": self.heads,
            "skipped": list(self.skipped),
            "failures": self.failures,
            "images": {"mode": self.images, "count": 0 if self.images == "none" else self.rows},
            "versions": dict(sorted(self.versions.items())),
            "configuration_digest": configuration_digest(self.configuration),
            "configuration": self.configuration,
            "tables": self.tables,
            "parts": [asdict(part) for part in sorted(self.parts, key=lambda part: part.path)],
            **({"twins": self._twins_dict()} if self.twins else {}),
            "created_by": self.created_by,
            **({} if self.files is None else {"files": self.files}),
            **self.others,
        }

    def _twins_dict(self) -> dict[str, Any]:
        return {
            "digest": self.twins_digest,
            "rows": sum(part.rows for part in self.twins),
            "detected_rows": sum(part.detected for part in self.twins),
            "parts": [asdict(part) for part in sorted(self.twins, key=lambda part: part.path)],
        }


def configuration_digest(configuration: Mapping[str, Any]) -> str:
    """SHA-256, hex, of a configuration as JSON with sorted keys."""
    text = json.dumps(
        configuration, sort_keys=True, ensure_ascii=False, separators=(",", ":"), allow_nan=False
    )
    return hashlib.sha256(text.encode()).hexdigest()


def parts_configuration(manifest: Manifest) -> dict[str, Any]:
    """The configuration whose digest stands in the metadata of the parts."""
    if is_newer("1.1.0", manifest.schema_version):  # before a dataset could grow: all of it
        return manifest.configuration
    return common_values(manifest.configuration)


def side_tables(schema_version: str) -> tuple[str, ...]:
    """Names of the tables that lie beside the parts of a dataset of this schema version."""
    anchors = () if is_newer(ANCHORS_SINCE, schema_version) else (ANCHORS_FILE,)
    return (HEADS_FILE, *anchors, POSES_FILE)


def covered_files(root: Path) -> dict[str, str]:
    """SHA-256 of the small files of a dataset that no reader of its rows needs, where they are there.

    Raises OSError if one cannot be read.
    """
    there = [name for name in (CONFIG_FILE, FAILURES_FILE) if (root / name).exists()]
    return {name: file_sha256(dataset_file(root, name)) for name in there}


def portable_command(arguments: Sequence[str]) -> str:
    """A command line without the folders of the machine it ran on: "/home/x/a.toml" becomes "a.toml"."""
    return " ".join(_without_folder(argument) for argument in arguments)


def write_manifest(manifest: Manifest, root: Path) -> None:
    """Write manifest.json atomically, as the last file of a dataset.

    Raises DatasetError: one of its :func:`side_tables` is not there, or it cannot write.
    """
    try:
        tables = {
            name: file_sha256(dataset_file(root, name)) for name in side_tables(manifest.schema_version)
        }
    except OSError as error:
        raise DatasetError(
            f"{error.filename}: cannot be read ({error.strerror}); write it before the manifest"
        ) from error
    manifest = replace(manifest, tables=tables, files=covered_files(root))
    text = json.dumps(sealed(manifest.as_dict()), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    write_bytes(root / MANIFEST_FILE, text.encode())


def read_manifest(root: Path) -> Manifest:
    """The manifest of a finished dataset.

    Raises DatasetError: there is none, it is not one, it is of another version, it
    contradicts itself, or its seal is not its own.
    """
    if not root.is_dir():
        what = "a file" if root.exists() else "no such folder"
        raise DatasetError(f"{root}: {what}; give the folder that `headturn build --out` wrote")
    path = dataset_file(root, MANIFEST_FILE)
    if not path.exists():
        around = next((one for one in root.resolve().parents if (one / MANIFEST_FILE).is_file()), None)
        if around is not None:
            raise DatasetError(f"{root}: a part of a dataset; give all of it, {around}")
        raise DatasetError(
            f"{root}: not a Headturn dataset, or its build did not finish (no {MANIFEST_FILE}); "
            "run `headturn build` again"
        )
    try:
        values = parse_json(read_limited(path, MAX_STATE_BYTES))
        check_schema_version(values["schema_version"], str(path))
        known = _known(values)
        manifest = _parse(known)
        changed = [key for key, value in manifest.as_dict().items() if known[key] != value]
    except ValidationError as error:
        first = error.errors()[0]
        what = f"{printable('.'.join(map(str, first['loc'])))}: {printable(first['msg'])}"
        raise DatasetError(
            f"{path}: not a manifest of Headturn ({what}); run `headturn build` again"
        ) from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(
            f"{path}: not a manifest of Headturn ({type(error).__name__}: {printable(one_line(error))}); "
            "run `headturn build` again"
        ) from error
    # Before there were seals a manifest had none.
    if not changed and SEAL in values and values[SEAL] != seal_of(values):
        changed = ["something in it"]
    if changed:
        raise DatasetError(
            f"{path}: {', '.join(changed)} contradicts the rest: the file was changed after the build; "
            "run `headturn build` again"
        )
    return manifest


class _Part(BaseModel):
    """A :class:`PartInfo`, from a file that may say anything."""

    model_config = ConfigDict(strict=True, extra="forbid")

    path: str
    rows: Annotated[int, Field(ge=0)]
    detected: Annotated[int, Field(ge=0)]
    bytes: Annotated[int, Field(ge=0)]
    sha256: Annotated[str, Field(pattern=_HASH)]
    digest: Annotated[str, Field(pattern=_HASH)]
    subject: str
    expression: str


class _Images(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")

    mode: str
    count: int


class _Twins(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")

    digest: str
    rows: int
    detected_rows: int
    parts: Annotated[list[_Part], Field(min_length=1)]


class _Stored(BaseModel):
    """manifest.json, from a file that may say anything. See :meth:`Manifest.as_dict`."""

    model_config = ConfigDict(strict=True, extra="forbid")

    schema_version: str
    digest: str
    rows: int
    detected_rows: int
    heads: Annotated[int, Field(ge=0)]
    skipped: list[dict[str, str]]
    failures: Annotated[int, Field(ge=0)]
    images: _Images
    versions: dict[str, str]
    configuration_digest: str
    configuration: dict[str, Any]
    tables: dict[str, str]
    parts: Annotated[list[_Part], Field(min_length=1)]
    created_by: str
    files: dict[str, str] | None = None
    twins: _Twins | None = None
    sha256: str = ""


def _known(values: dict[str, Any]) -> dict[str, Any]:
    """The values without what a later schema says of a part besides."""
    if not is_newer(values["schema_version"]):
        return values

    def known(parts: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [{name: part[name] for name in _Part.model_fields} for part in parts]

    found = {**values, "parts": known(values["parts"])}
    if "twins" in values:
        twins = values["twins"]
        found["twins"] = {
            **{name: twins[name] for name in _Twins.model_fields},
            "parts": known(twins["parts"]),
        }
    return found


def _parse(values: dict[str, Any]) -> Manifest:
    others = {}
    if is_newer(values["schema_version"]):
        others = {name: value for name, value in values.items() if name not in _Stored.model_fields}
    stored = _Stored.model_validate({name: value for name, value in values.items() if name not in others})
    twins = stored.twins.parts if stored.twins else []
    for part, where in [*((p, _PART_PATH) for p in stored.parts), *((p, _TWINS_PATH) for p in twins)]:
        if not where.fullmatch(part.path):
            raise ValueError(f"{part.path!r} is not where a part can be")
        for name in filter(None, (part.subject, part.expression)):
            as_name(name)
    if stored.images.mode not in IMAGE_MODES:
        raise ValueError(f"images: {stored.images.mode!r} is none of {', '.join(IMAGE_MODES)}")
    if "headturn" not in stored.versions:
        raise ValueError("versions name no headturn")
    return Manifest(
        versions=stored.versions,
        configuration=stored.configuration,
        parts=tuple(PartInfo(**part.model_dump()) for part in stored.parts),
        images=cast(ImageMode, stored.images.mode),
        heads=stored.heads,
        skipped=tuple(stored.skipped),
        failures=stored.failures,
        created_by=stored.created_by,
        tables=stored.tables,
        files=stored.files,
        schema_version=stored.schema_version,
        twins=tuple(PartInfo(**part.model_dump()) for part in twins),
        others=others,
    )


def _without_folder(argument: str) -> str:
    option, equals, value = argument.rpartition("=")
    for kind in (PurePosixPath, PureWindowsPath):
        if kind(value).is_absolute():
            value = kind(value).name
    return option + equals + value
