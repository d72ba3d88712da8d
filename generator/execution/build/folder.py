# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a dataset before and after a build: is it ours, may it grow, what must go."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from generator.dataset.format.anchors_table import ANCHORS_FILE
from generator.dataset.format.build_files import FIRST_PLACED_FILE, LOG_FILE, PLACED_FILE, RECEIPTS_FILE
from generator.dataset.format.files import write_bytes
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import HEADS_FILE
from generator.dataset.format.manifest import CONFIG_FILE, FAILURES_FILE, MANIFEST_FILE
from generator.dataset.format.open import read_rows
from generator.dataset.format.part_info import PartInfo
from generator.dataset.show.card import CARD_FILE
from generator.errors import DatasetError
from generator.execution.build.lock import LOCK_FILE
from generator.execution.build.receipts import Receipts
from generator.execution.build.unit_check import row_names
from generator.heads.head import SkippedHead
from generator.messages import BuildOrder
from generator.names import is_text
from generator.plan.config import BuildConfig, config_toml, differences, read_recorded
from generator.plan.factors import PART_FOLDERS
from generator.plan.pose_plans import POSES_FILE, HeadName, PosePlans, is_drawn, poses_csv
from generator.plan.poses import pose_name
from generator.plan.settings import all_settings

MADE_HEADS = "heads"
SHEET_FILE, ANCHOR_SHEET_FILE, MAP_FILE = "contact_sheet.png", "anchors.png", "detection_rate.png"

WRITTEN = (
    CONFIG_FILE, POSES_FILE, FAILURES_FILE, MANIFEST_FILE, HEADS_FILE, ANCHORS_FILE, CARD_FILE, SHEET_FILE,
    ANCHOR_SHEET_FILE, MAP_FILE, LOG_FILE, RECEIPTS_FILE, PLACED_FILE,
    FIRST_PLACED_FILE, MADE_HEADS, *PART_FOLDERS, "images", "exr",
)  # fmt: skip
"""Everything a build writes into a dataset's folder."""

Confirm = Callable[[str], bool]
"""Asks whether something may be done; the text says what."""


def claim(root: Path) -> None:
    """Make the folder root if it is missing. Raises DatasetError if it holds something else."""
    if not is_text(str(root)):
        raise DatasetError(f"{root}: the path holds bytes that are no text in UTF-8; choose another --out")
    try:
        root.mkdir(parents=True, exist_ok=True)
        ours = (root / CONFIG_FILE).is_file() or all(path.name == LOCK_FILE for path in root.iterdir())
    except OSError as error:
        raise DatasetError(f"{root}: cannot write there ({error.strerror}); choose another --out") from error
    if not ours and (root / MANIFEST_FILE).is_file():
        raise DatasetError(
            f"{root} holds a dataset without its {CONFIG_FILE}, as headturn compact writes them; "
            "continue the one that it was made from, or choose another --out"
        )
    if not ours:
        raise DatasetError(f"{root} is not empty and not a Headturn dataset; choose another --out")
    for name in WRITTEN:
        dataset_file(root, name)  # through a link a build would write, and delete, elsewhere


def as_begun(config: BuildConfig, root: Path) -> tuple[BuildConfig, bool]:
    """The configuration with which the dataset in root goes on, and whether it differs from what was asked.

    A dataset whose heads share their random poses goes on so: other draws would replace all of its rows.
    """
    file = root / CONFIG_FILE
    poses = config.poses
    if poses.same or not is_drawn(poses) or not (file.is_file() and (root / POSES_FILE).exists()):
        return config, False
    begun = read_recorded(file).poses
    if not (begun.same and is_drawn(begun)):
        return config, False
    return replace(config, poses=replace(poses, same=True)), True


def check_configuration(config: BuildConfig, root: Path) -> bool:
    """May this configuration be built in root? Returns whether a dataset of it is there already.

    Where nothing was rendered yet, because a first try failed on its heads, any configuration may.
    Raises DatasetError, with what differs, if root holds a dataset whose rows would be others.
    """
    mark = root / CONFIG_FILE
    if not mark.is_file():
        return False
    may_grow = {known.name for known in all_settings() if known.info.grows}
    differing = differences(config, read_recorded(mark))
    changed = [what for name, what in differing.items() if name not in may_grow]
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
    write_bytes(root / CONFIG_FILE, config_toml(config.moved_to(root)).encode())


def begin(config: BuildConfig, root: Path) -> None:
    """Write what is to be built; from here on the dataset is unfinished until a new manifest says otherwise.

    Raises DatasetError if root cannot be written.
    """
    (root / MANIFEST_FILE).unlink(missing_ok=True)
    mark(config, root)


def write_poses(plans: PosePlans, root: Path) -> None:
    """Write poses.csv, once parts under earlier names are gone: before, it is what tells whose they were.

    Raises DatasetError if root cannot be written.
    """
    write_bytes(root / POSES_FILE, poses_csv(plans).encode())


def stale_parts(root: Path, orders: Iterable[BuildOrder]) -> list[str]:
    """Parts that no order accounts for, relative to root. Removes what a killed build left half-written."""
    planned = {order.part_path for order in orders}
    stale = []
    there = (path for folder in PART_FOLDERS for path in sorted((root / folder).rglob("*")))
    for path in there:
        if path.name.startswith(".") and path.suffix == ".tmp":
            path.unlink()
        elif path.suffix == ".parquet" and path.relative_to(root).as_posix() not in planned:
            stale.append(path.relative_to(root).as_posix())
    return stale


def spare_skipped(stale: Iterable[str], skipped: Iterable[SkippedHead], receipts: Receipts) -> None:
    """Raises DatasetError if a part would go only because its head could not be used this time."""
    reasons = {(head.subject, head.expression): head.reason for head in skipped}
    for path in stale if reasons else ():
        if (head := receipts.head_of(path)) in reasons:
            raise DatasetError(
                f"{path} belongs to {'/'.join(head)}, which was built before but not this time "
                f"({reasons[head]}); nothing was changed. Mend that head, or take it out of the source"
            )


def ask_to_drop(stale: Sequence[str], root: Path, confirm: Confirm, changed: Sequence[str] = ()) -> None:
    """Ask before parts are removed. Raises DatasetError if the answer is no; then nothing was changed.

    changed: files of heads that are not as they were when the dataset was finished.
    """
    if stale:
        more = f", and {len(changed) - 1} more" if len(changed) > 1 else ""
        why = f" ({changed[0]} was changed since{more})" if changed else ""
        _ask(
            confirm,
            f"{root}: {len(stale)} parts of heads, poses or versions outside this plan{why} will be deleted",
        )


def drop(
    stale: Iterable[str],
    root: Path,
    heads: Iterable[HeadName],
    plans: PosePlans,
    orders: Iterable[BuildOrder],
) -> None:
    """Remove parts, and the files they name that neither a pose of a planned head nor a twin needs.

    orders: of the plan; they know the twins.
    """
    twins = {
        (order.head.subject, order.head.expression, name)
        for order in orders
        if order.factor
        for name in row_names(order)
    }
    kept: dict[HeadName, set[str]] = {}
    names: dict[int, set[str]] = {}  # of a plan, which many heads may share
    for head in heads:
        plan = plans.of(*head)
        if id(plan) not in names:
            names[id(plan)] = {pose_name(*pose) for pose in plan.angles_deg.tolist()}
        kept[head] = names[id(plan)]
    for path in stale:
        for file in _files_of(root, path):
            _, subject, expression, name = file.parts
            row = name.removesuffix(file.suffix)
            if row not in kept.get((subject, expression), ()) and (subject, expression, row) not in twins:
                dataset_file(root, file.as_posix()).unlink(missing_ok=True)
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
