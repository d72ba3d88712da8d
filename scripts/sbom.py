# SPDX-License-Identifier: GPL-3.0-or-later
"""What a distribution is made of and stands on, as a CycloneDX bill of materials.

The versions and hashes are those of requirements/lock-dev.txt, with which a release is tested; what depends
on what, and licences, are read off the packages that are installed.
"""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Iterable
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, metadata, requires
from pathlib import Path
from zipfile import ZipFile

import lock
from cyclonedx.model import HashAlgorithm, HashType
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentScope, ComponentType
from cyclonedx.model.license import DisjunctiveLicense
from cyclonedx.output.json import JsonV1Dot6
from packageurl import PackageURL
from packaging.metadata import parse_email
from packaging.requirements import Requirement

EXTRAS = {"downstream-hpe": "pose", "headturn": "build"}
"""What a distribution is mostly installed with; its packages are listed as optional."""
MODELS = (".onnx", ".npz")
"""Endings of files in a wheel that are data somebody computed, and are listed one by one."""
LONGEST_LICENCE = 60
"""Characters; longer ones are the text and not the name."""


def write_bom(wheel: Path, name: str, ours: lock.Pins, seconds: int, out: Path) -> Path:
    """Write NAME-VERSION.cdx.json into a folder. ours: of the wheels that are built. seconds: its date,
    since 1970."""
    version, digest = ours[name]
    pins = lock.read_lock(lock.lock_file("dev")) | ours
    root = _component(name, version, digest, ComponentType.APPLICATION)
    wanted = required(wheel)
    needed = closure(wanted, "")
    parts = [
        _component(
            one,
            *pins.get(one, (None, None)),
            scope=ComponentScope.REQUIRED if one in needed else ComponentScope.OPTIONAL,
        )
        for one in sorted(needed | closure(wanted, EXTRAS[name]))
    ]
    bom = Bom(components=[*parts, *models(wheel)], serial_number=uuid.uuid5(uuid.NAMESPACE_OID, digest))
    bom.metadata.component = root
    bom.metadata.timestamp = datetime.fromtimestamp(seconds, tz=timezone.utc)
    bom.register_dependency(root, [part for part in parts if part.name in {named(one) for one in wanted}])
    target = out / f"{name}-{version}.cdx.json"
    target.write_text(JsonV1Dot6(bom).output_as_string(indent=2) + "\n", encoding="utf-8")
    return target


def required(wheel: Path) -> list[Requirement]:
    """What a wheel asks for."""
    with ZipFile(wheel) as archive:
        [member] = (one for one in archive.namelist() if one.endswith(".dist-info/METADATA"))
        said, _ = parse_email(archive.read(member))
    return [Requirement(text) for text in said.get("requires_dist", [])]


def closure(wanted: Iterable[Requirement], extra: str) -> set[str]:
    """Normalised names of everything that these bring along here, with one extra or ""."""
    found: set[str] = set()
    todo = [(one, extra) for one in wanted]
    seen = set()
    while todo:
        one, asked_by = todo.pop()
        if one.marker is not None and not one.marker.evaluate({"extra": asked_by}):
            continue
        found.add(named(one))
        for more in one.extras or {""}:
            if (named(one), more) not in seen:
                seen.add((named(one), more))
                todo += [(Requirement(text), more) for text in _requires(one.name)]
    return found


def named(requirement: Requirement) -> str:
    """Its normalised name."""
    return lock.normalised(requirement.name)


def models(wheel: Path) -> list[Component]:
    """The computed files of a wheel."""
    with ZipFile(wheel) as archive:
        contents = {one: archive.read(one) for one in archive.namelist() if one.endswith(MODELS)}
    return [
        Component(
            name=one, type=ComponentType.FILE, bom_ref=one, hashes=[_sha256(hashlib.sha256(data).hexdigest())]
        )
        for one, data in sorted(contents.items())
    ]


def _requires(name: str) -> list[str]:
    try:
        return requires(name) or []
    except PackageNotFoundError:
        return []  # of ours, or not for this system


def _component(
    name: str,
    version: str | None,
    digest: str | None,
    kind: ComponentType = ComponentType.LIBRARY,
    scope: ComponentScope | None = None,
) -> Component:
    url = PackageURL("pypi", name=name, version=version)
    hashes = [] if digest is None else [_sha256(digest)]
    licences = [DisjunctiveLicense(name=licence) for licence in [_licence(name)] if licence]
    return Component(
        name=name, version=version, type=kind, purl=url, bom_ref=str(url),
        hashes=hashes, licenses=licences, scope=scope,
    )  # fmt: skip


def _sha256(digest: str) -> HashType:
    return HashType(alg=HashAlgorithm.SHA_256, content=digest)


def _licence(name: str) -> str | None:
    """As a package that is installed names it."""
    try:
        said = metadata(name)
    except PackageNotFoundError:
        return None
    classified = [one for one in said.get_all("Classifier") or [] if one.startswith("License ::")]
    texts = [
        said.get("License-Expression"),
        said.get("License"),
        *(one.rpartition(" :: ")[2] for one in classified),
    ]
    return next((text for text in texts if text and "\n" not in text and len(text) <= LONGEST_LICENCE), None)
