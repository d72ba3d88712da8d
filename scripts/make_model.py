# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the model that is shipped: build its data, fit it, measure it, write the graph and its card.

    python scripts/make_model.py --work model-work --ict /data/ICT-FaceKit   # all of it
    python scripts/make_model.py --work /tmp/small --scale 0.05 --epochs 2 --models /tmp/small/models

Run again after an interruption, it goes on where it stopped. --ict is a copy of ICT-FaceKit (docs/heads.md
says where to get it), which the shipped model learned from; without it all heads are parametric. With
--others it also measures on the heads of a folder, with --photographs on landmarks of labelled photographs;
neither is ever trained on.
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
COMMON = "--frame level --images none --json"
CARD = ROOT / "scripts" / "model_card.md"

BOUNDS = "--yaw=-50,50 --pitch=-40,40 --roll=-30,30"
VARIED = "--variety photo"
FAR = f"{VARIED} --distance log-uniform:2000,12000 --margin uniform:1,1.6"
"""As photographs are taken: a detector's errors of yaw change sign with the distance."""
ICT = "ICT-FaceKit, a model made from scans of people (MIT, USC Institute for Creative Technologies)"
NOT_MEASURED = "Not measured in this run: give `scripts/make_model.py` `--photographs FILE`."


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
    resolution: int = 192
    fewest: int = 2

    def command(self, folder: Path, scale: float, source: str) -> list[str]:
        """headturn build, with scale times as many heads and poses. source: "parametric", "ict:PATH", or a
        folder of heads."""
        count = max(self.fewest, round(self.heads * scale))
        made = ["--count", str(count), "--sampled-expressions", str(self.expressions)]
        plan = ["--poses", f"sobol:{max(6, round(self.poses * scale))}"] if self.poses else []
        return [
            *_python("generator"),
            "build",
            *("--heads", source),
            *(made if self.heads else []),
            *("--seed", str(self.seed)),
            *plan,
            *self.flags.split(),
            *("--resolution", str(self.resolution)),
            *COMMON.split(),
            *("--out", str(folder / self.name)),
        ]


GRID = Build("grid", 8, 1100, 0, 0, f"--yaw=-50,50,25 --pitch=-40,40,20 --roll=-30,30,20 {FAR}", fewest=8)
TRAINING = (
    # Where most faces look; a few from nearby.
    Build("train1", 120, 7201, 1, 20, f"--yaw=-45,45 --pitch=-35,35 --roll=-25,25 {FAR}"),
    Build("train2", 40, 7101, 1, 10, f"--yaw=-40,40 --pitch=-30,30 --roll=-20,20 {VARIED}", 256),
    *(Build("train3", 48, 1103, 1, 16, f"--yaw=-88,88 --pitch=-35,35 --roll=-40,40 {FAR}"),) * 2,
)
"""The last, profiles that seldom look up or down, is gone over twice an epoch."""
JUDGES = Build(
    "judges", 12, 7305, 1, 12, "--yaw=-89,89 --pitch=-25,25 --roll=-25,25 --distance 3000 --zoom", 256
)
"""Plain images that the confidence is calibrated on, twice, beside the varied ones of who is held out:
photographs are harder than these, and easier than those."""
TESTS = {
    "Parametric heads it has never seen, from three metres, in plain images": Build(
        "test_plain", 24, 9021, 1, 12, f"{BOUNDS} --distance 3000 --zoom", 256
    ),
    "Parametric heads it has never seen, in varied images": Build(
        "test_varied", 24, 9022, 1, 12, f"{BOUNDS} {VARIED}", 256
    ),
}
ICT_TEST = Build("test_ict", 24, 9025, 1, 12, f"{BOUNDS} {VARIED}", 256)
BEYOND = Build("test_beyond", 12, 9024, 1, 16, f"--yaw=-85,85 --pitch=-60,60 --roll=-60,60 {VARIED}", 256)
PROFILE = Build(
    "test_profile", 12, 9026, 0, 24, "--yaw=-89,89 --pitch=-20,20 --roll=-20,20 --distance 3000 --zoom", 256
)
OTHERS = Build("others", 0, 9023, 0, 128, f"{BOUNDS} {VARIED}", 256)


def _python(package: str) -> list[str]:
    return [sys.executable, "-m", f"{package}.cli"]


def run(command: list[str]) -> str:
    """Run a command of this repository from its root; its standard output."""
    print("+", shlex.join(command), flush=True)
    # One thread adds in one order, so that the same data give the same weights.
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(command, check=True, cwd=ROOT, env=alone, stdout=subprocess.PIPE, text=True).stdout


def build(one: Build, folder: Path, scale: float, source: str) -> Path:
    """The dataset of one build, made unless it is there."""
    done = folder / one.name / "manifest.json"
    if not done.exists():
        run(one.command(folder, scale, source))
    return done.parent


def table(text: str, first: str) -> str:
    """The table of `downstream-hpe evaluate` whose header begins with a word."""
    [found] = [part.strip() for part in text.split("\n\n") if part.strip().startswith(f"| {first}")]
    return found


def evaluated(model: Path, dataset: Path, report: Path, *options: str) -> str:
    """What `downstream-hpe evaluate` prints."""
    command = [*_python("downstream_hpe"), "evaluate", str(model), str(dataset), "--out", str(report)]
    return run([*command, *options])


def photographs(model: Path, file: Path | None) -> str:
    """What scripts/photographs.py prints, without the names of those it found no face in."""
    if file is None:
        return NOT_MEASURED
    said = run([sys.executable, str(ROOT / "scripts" / "photographs.py"), str(file), "--model", str(model)])
    shown = [line for line in said.splitlines() if not line.startswith("  ")]
    return "\n".join(shown).replace(str(model), NAME).strip()


def main() -> None:
    """Build, fit, measure, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--work", type=Path, default=Path("model-work"), help="folder for datasets and model")
    parser.add_argument("--models", type=Path, default=ROOT / "downstream_hpe" / "models")
    parser.add_argument("--scale", type=float, default=1.0, help="share of heads and poses; for trying out")
    parser.add_argument("--epochs", type=int, help="instead of the recipe's")
    parser.add_argument("--ict", type=Path, help="a copy of ICT-FaceKit to learn from")
    parser.add_argument("--others", help="a folder of heads that are not made on the spot, to measure on")
    parser.add_argument("--photographs", type=Path, help="a file of scripts/photographs.py, to measure on")
    given = parser.parse_args()
    work = given.work.absolute()
    source = f"ict:{given.ict.absolute()}" if given.ict else "parametric"

    grid, *training = (build(one, work, given.scale, source) for one in (GRID, *TRAINING))
    judges = build(JUDGES, work, given.scale, source)
    model = work / "model"
    fit = [
        *_python("downstream_hpe"),
        "fit",
        str(grid),
        "--out",
        str(model),
        "--missing",
        "keep",
        "--partial",
        "--json",
    ]
    fit += ["--threads", "1"]
    fit += [word for path in training for word in ("--extra", str(path))]
    fit += [
        word
        for path in (*dict.fromkeys((grid, *training)), *[judges] * 2)
        for word in ("--calibrate", str(path))
    ]
    card = json.loads(run(fit + (["--epochs", str(given.epochs)] if given.epochs else [])))

    tests = [(name, one, "parametric") for name, one in TESTS.items()]
    if given.ict:
        tests.append(("Heads of ICT-FaceKit it has never seen, in varied images", ICT_TEST, source))
    if given.others:
        tests.append(("Scans and meshes that no part of this made, in varied images", OTHERS, given.others))
    measured = []
    for name, one, heads in tests:
        path = build(one, work, given.scale, heads)
        said = evaluated(model, path, work / "report" / one.name)
        measured.append(f"{name}:\n\n{table(said, 'estimator')}\n")
    beyond = build(BEYOND, work, given.scale, source)
    said = evaluated(model, beyond, work / "report" / BEYOND.name, "--all")
    partial = evaluated(model, beyond, work / "report" / "partial", "--all", "--partial")
    profile = build(PROFILE, work, given.scale, source)
    sideways = evaluated(model, profile, work / "report" / PROFILE.name, "--all")

    given.models.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(model / "model.onnx", given.models / f"{NAME}.onnx")
    size = (given.models / f"{NAME}.onnx").stat().st_size / 1e6
    shown = "ict:ICT-FaceKit" if given.ict else source
    facts = {
        "rows": f"{card['rows']:,}",
        "subjects": str(len(card["trained_subjects"])),
        "held_out": str(len(card["held_out_subjects"])),
        "heads": ICT if given.ict else "MakeHuman's CC0 data",
        "layers": "-".join(map(str, card["recipe"]["layers"])),
        "size": f"{size:.1f}",
        "builds": "\n".join(
            shlex.join(["headturn", *one.command(Path("work"), 1.0, shown)[3:]])
            for one in dict.fromkeys((GRID, *TRAINING, JUDGES))
        ),
        "extra": " ".join(f"--extra work/{one.name}" for one in TRAINING),
        "calibrate": " ".join(
            f"--calibrate work/{one.name}" for one in (*dict.fromkeys((GRID, *TRAINING)), JUDGES, JUDGES)
        ),
        "measured": "\n".join(measured).strip(),
        "photographs": photographs(model, given.photographs),
        "profile": table(sideways, "estimator"),
        "partial": f"{table(partial, 'estimator')}\n\n{table(partial, 'confidence')}",
        "beyond": f"{table(said, 'estimator')}\n\n{table(said, 'confidence')}",
    }
    text = CARD.read_text(encoding="utf-8")
    for key, value in facts.items():
        text = text.replace("{" + key + "}", value)
    (given.models / f"{NAME}.md").write_text(text, encoding="utf-8")
    print(f"{given.models / NAME}.onnx: {size:.1f} MB; its card beside it")


if __name__ == "__main__":
    main()
