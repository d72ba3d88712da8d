# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the model that is shipped: build its data, fit it, measure it, write the graph and its card.

    python scripts/make_model.py --work model-work                   # all of it: a long run
    python scripts/make_model.py --work /tmp/small --scale 0.05 --epochs 2 --models /tmp/small/models

Run again after an interruption, it goes on where it stopped. With --others it also measures on the
heads of a folder, which are not parametric ones; they are never trained on.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NAME = "headturn"
COMMON = "--frame canonical --images none --json"
CARD = ROOT / "scripts" / "model_card.md"

BOUNDS = "--yaw=-50,50 --pitch=-40,40 --roll=-30,30"
WIDER = "--yaw=-65,65 --pitch=-55,55 --roll=-45,45"
"""Trained on more than is promised, so that the promised range ends where the model still knows."""
A_LITTLE_WIDER = "--yaw=-55,55 --pitch=-45,45 --roll=-35,35"
CLOSER = "--yaw=-35,35 --pitch=-28,28 --roll=-20,20"
"""Evenly drawn over the whole range, few poses are where most faces look: about the front."""
BEYOND = "--yaw=-85,85 --pitch=-70,70 --roll=-60,60"


@dataclass(frozen=True)
class Build:
    """One dataset. poses: of a random plan, an image each; 0 for a grid, whose axes are in flags.
    resolution: of the images, pixels. fewest: heads, however small the scale."""

    name: str
    heads: int
    seed: int
    expressions: int
    poses: int
    flags: str
    resolution: int = 256
    fewest: int = 2

    def command(self, folder: Path, scale: float, others: str | None = None) -> list[str]:
        """headturn build, with scale times as many heads and poses."""
        count = max(self.fewest, round(self.heads * scale))
        source = ["--count", str(count), "--sampled-expressions", str(self.expressions)]
        plan = ["--poses", f"sobol:{max(6, round(self.poses * scale))}"] if self.poses else []
        return [
            *_python("generator"),
            "build",
            *(["--heads", others] if others else source),
            *("--seed", str(self.seed)),
            *plan,
            *self.flags.split(),
            *("--resolution", str(self.resolution)),
            *COMMON.split(),
            *("--out", str(folder / self.name)),
        ]


GRID = Build("grid", 16, 2001, 0, 0, "--yaw=-50,50,25 --pitch=-40,40,20 --roll=-30,30,15 --lens 70", fewest=8)
LOOKS = (
    f"{WIDER} --lens 50 --light=25,35 --background 0.5,0.5,0.5",
    f"{WIDER} --lens 85 --light=-45,20 --background 0.15,0.15,0.18",
    f"{WIDER} --lens 35 --light=0,60 --background 0.8,0.8,0.8",
    f"{CLOSER} --lens 135 --light=50,10 --background 0.6,0.5,0.4",
    f"{CLOSER} --lens 42 --light=-15,55 --background 0.9,0.9,0.95",
    f"{WIDER} --lens 65 --light=10,75 --background 0.35,0.45,0.4",
    f"{CLOSER} --lens 100 --light=-60,30 --background 0.05,0.05,0.05",
    f"{WIDER} --lens 50 --light=35,50 --background 0.7,0.75,0.85",
)
MORE_LOOKS = (
    (f"{WIDER} --lens 60 --light=20,25 --background 0.4,0.4,0.4", 256),
    (f"{WIDER} --lens 40 --light=-30,45 --background 0.75,0.7,0.65", 256),
    (f"{WIDER} --lens 90 --light=5,35 --background 0.2,0.25,0.2", 256),
    (f"{WIDER} --lens 28 --light=40,30 --background 0.95,0.95,0.95", 256),
    (f"{A_LITTLE_WIDER} --lens 55 --light=-35,30 --background 0.55,0.5,0.45", 256),
    (f"{WIDER} --lens 75 --light=15,60 --background 0.3,0.3,0.35", 256),
    (f"{A_LITTLE_WIDER} --lens 32 --light=-5,15 --background 0.65,0.7,0.7", 160),
    (f"{WIDER} --lens 45 --light=55,40 --background 0.1,0.12,0.1", 256),
    (f"{A_LITTLE_WIDER} --lens 110 --light=-25,65 --background 0.85,0.8,0.75", 160),
    (f"{WIDER} --lens 38 --light=30,20 --background 0.5,0.55,0.6", 128),
)
LAST_LOOKS = (
    (1021, f"{A_LITTLE_WIDER} --lens 85 --light=45,25 --background 0.45,0.5,0.55", 256),
    (1022, f"{A_LITTLE_WIDER} --lens 35 --light=-20,70 --background 0.7,0.65,0.6", 256),
    (1024, f"{A_LITTLE_WIDER} --lens 50 --light=0,30 --background 0.35,0.3,0.3", 192),
    (1025, f"{A_LITTLE_WIDER} --lens 135 --light=25,55 --background 0.15,0.2,0.25", 256),
    (1026, f"{WIDER} --lens 40 --light=-10,20 --background 0.55,0.55,0.5", 256),
    (1027, f"{A_LITTLE_WIDER} --lens 28 --light=35,65 --background 0.8,0.85,0.9", 256),
)
TRAINING = (
    *(Build(f"train{k}", 16, 1000 + k, 3, 44, look) for k, look in enumerate(LOOKS, 1)),
    # What a scan gains from most is more identities, so these are many and seen less often.
    *(
        Build(f"train{k}", 48, 1000 + k, 1, 22, *look_and_size)
        for k, look_and_size in enumerate(MORE_LOOKS, len(LOOKS) + 1)
    ),
    *(
        Build(f"train{k}", 48, seed, 1, 44, look, size)
        for k, (seed, look, size) in enumerate(LAST_LOOKS, len(LOOKS) + len(MORE_LOOKS) + 1)
    ),
)
BEYOND_RANGE = "beyond the range"
TESTS = {
    "Parametric heads it has never seen, on a grid": Build(
        "test_grid", 12, 9021, 0, 0, "--yaw=-50,50,20 --pitch=-40,40,20 --roll=-30,30,20 --lens 85"
    ),
    "Parametric heads it has never seen, half of them with expressions, off the grid": Build(
        "test_free", 24, 9022, 1, 32, f"{BOUNDS} --lens 60 --light=-20,40"
    ),
    BEYOND_RANGE: Build("test_beyond", 8, 9024, 1, 48, f"{BEYOND} --lens 60 --light=20,40"),
}
OTHERS = Build("others", 0, 9023, 0, 256, f"{BOUNDS} --lens 60")


def _python(package: str) -> list[str]:
    return [sys.executable, "-m", f"{package}.cli"]


def run(command: list[str]) -> str:
    """Run a command of this repository from its root; its standard output."""
    print("+", shlex.join(command), flush=True)
    # One thread adds in one order, so that the same data give the same weights.
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(command, check=True, cwd=ROOT, env=alone, stdout=subprocess.PIPE, text=True).stdout


def build(one: Build, folder: Path, scale: float, others: str | None = None) -> Path:
    """The dataset of one build, made unless it is there."""
    done = folder / one.name / "manifest.json"
    if not done.exists():
        run(one.command(folder, scale, others))
    return done.parent


def table(text: str, first: str) -> str:
    """The table of `downstream-hpe evaluate` whose header begins with a word."""
    [found] = [part.strip() for part in text.split("\n\n") if part.strip().startswith(f"| {first}")]
    return found


def main() -> None:
    """Build, fit, measure, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, default=Path("model-work"), help="folder for datasets and model")
    parser.add_argument("--models", type=Path, default=ROOT / "downstream_hpe" / "models")
    parser.add_argument("--scale", type=float, default=1.0, help="share of heads and poses; for trying out")
    parser.add_argument("--epochs", type=int, help="instead of the recipe's")
    parser.add_argument("--others", help="a folder of heads that are not parametric, to measure on")
    given = parser.parse_args()
    work = given.work.absolute()

    grid = build(GRID, work, given.scale)
    training = [build(one, work, given.scale) for one in TRAINING]
    model = work / "model"
    fit = [*_python("downstream_hpe"), "fit", str(grid), "--out", str(model), "--missing", "keep", "--json"]
    fit += ["--threads", "1"]
    fit += [word for path in training for word in ("--extra", str(path))]
    card = json.loads(run(fit + (["--epochs", str(given.epochs)] if given.epochs else [])))

    measured = []
    tests = {name: build(one, work, given.scale) for name, one in TESTS.items()}
    if given.others:
        tests["Other heads: scans and meshes that no part of this made"] = build(
            OTHERS, work, given.scale, given.others
        )
    for name, path in tests.items():
        evaluate = [*_python("downstream_hpe"), "evaluate", str(model), str(path)]
        evaluate += ["--out", str(work / "report" / path.name)]
        if name == BEYOND_RANGE:
            said = run([*evaluate, "--all"])
            beyond = f"{table(said, 'estimator')}\n\n{table(said, 'confidence')}"
        else:
            measured.append(f"{name}:\n\n{table(run(evaluate), 'estimator')}\n")

    given.models.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(model / "model.onnx", given.models / f"{NAME}.onnx")
    size = (given.models / f"{NAME}.onnx").stat().st_size / 1e6
    facts = {
        "rows": f"{card['rows']:,}",
        "subjects": str(len(card["trained_subjects"])),
        "held_out": str(len(card["held_out_subjects"])),
        "lights": str(len(TRAINING)),
        "layers": "-".join(map(str, card["recipe"]["layers"])),
        "size": f"{size:.1f}",
        "builds": "\n".join(
            shlex.join(["headturn", *one.command(Path("work"), 1.0)[3:]]) for one in (GRID, *TRAINING)
        ),
        "measured": "\n".join(measured).strip(),
        "beyond": beyond,
    }
    text = CARD.read_text(encoding="utf-8")
    for key, value in facts.items():
        text = text.replace("{" + key + "}", value)
    (given.models / f"{NAME}.md").write_text(text, encoding="utf-8")
    print(f"{given.models / NAME}.onnx: {size:.1f} MB; its card beside it")


if __name__ == "__main__":
    main()
