# SPDX-License-Identifier: GPL-3.0-or-later
"""One target under libFuzzer, in a process with limits: child.py TARGET FINDINGS [libFuzzer's options].

What a target raises against its promise is noted and the search goes on: the smallest input of each kind is
kept in the folder FINDINGS, with its traceback. A crash, ten seconds or a gigabyte end the process, and
libFuzzer keeps the input.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
import sys
import traceback
import warnings
from pathlib import Path

import atheris

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]


def main() -> None:
    """Search until libFuzzer ends the process."""
    name, findings, *options = sys.argv[1:]
    warnings.simplefilter("ignore")
    # What a target imports it imports at its first call, and only what is imported here is followed.
    with atheris.instrument_imports(include=["generator", "downstream_hpe", "litert_faces"]):
        import targets

        target, promised = targets.TARGETS[name], targets.promised()
        for file in sorted(target.corpus.glob("sound-*")):
            with contextlib.suppress(Exception):
                target.run(file.read_bytes())
        with contextlib.suppress(Exception):
            target.run(b"\xff")

    def one_input(data: bytes) -> None:
        try:
            target.run(data)
        except promised:
            return
        except Exception as error:
            _note(error, data, Path(findings), name)

    targets.limit_memory()
    words = Path(findings) / f"{name}.dict"
    words.write_text("".join(f'"{_escaped(word)}"\n' for word in target.words), encoding="utf-8")
    if target.words:
        options.append(f"-dict={words}")
    atheris.Setup([sys.argv[0], *options], one_input)
    atheris.Fuzz()


def _note(error: Exception, data: bytes, folder: Path, name: str) -> None:
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if re.search("/(generator|downstream_hpe|litert_faces)/", f.filename)] or list(
        frames
    )
    kind = f"{type(error).__name__} {Path(ours[-1].filename).name}:{ours[-1].lineno}"
    file = folder / f"{name}-{hashlib.sha256(kind.encode()).hexdigest()[:8]}"
    if not file.exists() or len(data) < file.stat().st_size:
        file.write_bytes(data)
        text = "".join(traceback.format_exception(error))
        file.with_suffix(".txt").write_text(f"{kind}\n{text}", encoding="utf-8", errors="backslashreplace")


def _escaped(word: str) -> str:
    return word.replace("\\", "\\\\").replace('"', '\\"')


if __name__ == "__main__":
    main()
