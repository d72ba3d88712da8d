# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a dataset before and after a build: is it ours, may it grow, what must go."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from generator.dataset.format.anchors_table import ANCHORS_FILE
from generator.dataset.format.files import write_bytes
from generator.dataset.format.heads_table import HEADS_FILE
from generator.dataset.format.manifest import MANIFEST_FILE, POSES_FILE
from generator.dataset.format.open import read_rows
from generator.dataset.format.part import PartInfo
from generator.dataset.show.card import CARD_FILE
from generator.errors import DatasetError
from generator.execution.build.lock import LOCK_FILE
from generator.execution.build.prepared_heads import PREPARED_FILE
from generator.execution.build.receipts import RECEIPTS_FILE, Receipts, part_path
from generator.execution.status import LOG_FILE
from generator.heads.head import SkippedHead
from generator.plan.config import BuildConfig, config_toml, differences, load_config
from generator.plan.poses import PosePlan, pose_name, poses_csv

CONFIG_FILE, FAILURES_FILE = "config.toml", "failures.jsonl"
MADE_HEADS = "heads"
SHEET_FILE, ANCHOR_SHEET_FILE, MAP_FILE = "contact_sheet.png", "anchors.png", "detection_rate.png"

WRITTEN = (
    CONFIG_FILE, POSES_FILE, FAILURES_FILE, MANIFEST_FILE, HEADS_FILE, ANCHORS_FILE, CARD_FILE, SHEET_FILE,
    ANCHOR_SHEET_FILE, MAP_FILE, LOG_FILE, RECEIPTS_FILE, PREPARED_FILE, MADE_HEADS, "data", "images", "exr",
)  # fmt: skip
"""Everything a build writes into a dataset's folder."""

MAY_GROW = {
    "heads.count", "heads.subjects", "heads.expressions", "heads.sampled_expressions", "poses.kind",
    "poses.yaw", "poses.pitch", "poses.roll", "poses.count", "poses.seed", "poses.path",
}  # fmt: skip
"""Settings that choose rows and do not change what is in one."""

Confirm = Callable[[str], bool]
"""Asks whether something may be done; the text says what."""


def claim(root: Path) -> None:
    """Make the folder root if it is missing. Raises DatasetError if it holds something else."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        ours = (root / CONFIG_FILE).is_file() or all(path.name == LOCK_FILE for path in root.iterdir())
    except OSError as error:
        raise DatasetError(f"{root}: cannot write there ({error.strerror}); choose another --out") from error
    if not ours:
        raise DatasetError(f"{root} is not empty and not a Headturn dataset; choose another --out")


def check_configuration(config: BuildConfig, root: Path) -> bool:
    """May this configuration be built in root? Returns whether a dataset of it is there already.

    Where nothing was rendered yet, because a first try failed on its heads, any configuration may.
    Raises DatasetError, with what differs, if root holds a dataset whose rows would be others.
    """
    mark = root / CONFIG_FILE
    if not mark.is_file():
        return False
    changed = differences(config, load_config(mark, {}))
    changed = [what for what in changed if what.split(":")[0] not in MAY_GROW]
    if changed and not (root / POSES_FILE).exists():
        if (root / MADE_HEADS).is_dir():
            shutil.rmtree(root / MADE_HEADS)
        return False
    if changed:
        raise DatasetError(
            f"{root} already holds a dataset of another configuration ({'; '.join(changed)}); "
            "choose another --out, or start over with --fresh"
        )
    return True


def start_over(root: Path, confirm: Confirm) -> None:
    """Remove everything a build wrote into root, after asking. Raises DatasetError if the answer is no."""
    there = [root / name for name in WRITTEN if (root / name).exists()]
    if not there:
        return
    _ask(confirm, f"{root}: the dataset there will be deleted")
    # The mark goes last: until then the folder is known to be ours.
    for path in sorted(there, key=lambda path: path.name == CONFIG_FILE):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def mark(config: BuildConfig, root: Path) -> None:
    """Make root this configuration's folder. Raises DatasetError if it cannot be written."""
    write_bytes(root / CONFIG_FILE, config_toml(config).encode())


def begin(config: BuildConfig, plan: PosePlan, chunks: np.ndarray, root: Path) -> None:
    """Write what is to be built; from here on the dataset is unfinished until a new manifest says otherwise.

    Raises DatasetError if root cannot be written.
    """
    (root / MANIFEST_FILE).unlink(missing_ok=True)
    mark(config, root)
    write_bytes(root / POSES_FILE, poses_csv(plan, chunks).encode())


def stale_parts(root: Path, orders: Iterable[dict[str, Any]]) -> list[str]:
    """Parts that no order accounts for, relative to root. Removes what a killed build left half-written."""
    planned = {part_path(order) for order in orders}
    stale = []
    for path in sorted((root / "data").rglob("*")):
        if path.name.startswith(".") and path.suffix == ".tmp":
            path.unlink()
        elif path.suffix == ".parquet" and path.relative_to(root).as_posix() not in planned:
            stale.append(path.relative_to(root).as_posix())
    return stale


def spare_skipped(stale: Iterable[str], skipped: Iterable[SkippedHead], receipts: Receipts) -> None:
    """Raises DatasetError if a part would go only because its head could not be used this time."""
    reasons = {(head.subject, head.expression): head.reason for head in skipped}
    for path in stale:
        if (head := receipts.head_of(path)) in reasons:
            raise DatasetError(
                f"{path} belongs to {'/'.join(head)}, which was built before but not this time "
                f"({reasons[head]}); nothing was changed. Mend that head, or take it out of the source"
            )


def ask_to_drop(stale: Sequence[str], root: Path, confirm: Confirm) -> None:
    """Ask before parts are removed. Raises DatasetError if the answer is no; then nothing was changed."""
    if stale:
        _ask(
            confirm,
            f"{root}: {len(stale)} parts of heads, poses or versions outside this plan will be deleted",
        )


def drop(stale: Iterable[str], root: Path, heads: Iterable[tuple[str, str]], plan: PosePlan) -> None:
    """Remove parts, and the files they name that no planned (subject, expression) x pose needs."""
    kept_heads = set(heads)
    kept_poses = {pose_name(*pose) for pose in plan.angles_deg.tolist()}
    for path in stale:
        for file in _files_of(root, path):
            _, subject, expression, name = file.parts
            if (subject, expression) not in kept_heads or name.removesuffix(file.suffix) not in kept_poses:
                (root / file).unlink(missing_ok=True)
        (root / path).unlink()


def _files_of(root: Path, part: str) -> list[PurePosixPath]:
    """Files a part names; none if it cannot be read, or they would lie elsewhere."""
    info = PartInfo(part, 0, 0, 0, "", "", "", "")
    columns = {"image_path": "images", "passes_path": "exr"}
    files = []
    try:
        for batch in read_rows(root, [info], list(columns)):
            for column, folder in columns.items():
                named = map(PurePosixPath, batch.column(column).to_pylist())
                files += [
                    n for n in named if len(n.parts) == 4 and n.parts[0] == folder and ".." not in n.parts
                ]
    except DatasetError:
        return []
    return files


def _ask(confirm: Confirm, what: str) -> None:
    if not confirm(what):
        raise DatasetError(f"{what}; nothing was changed. Agree with --yes, or choose another --out")
