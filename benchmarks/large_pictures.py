# SPDX-License-Identifier: MIT
"""How long pictures of 200 megapixels take to read, and how much memory: each in a process of its own.

python benchmarks/large_pictures.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from downstream_hpe.prediction.pictures import read_picture

SIZE = (16320, 12240)
"""As phones have it."""
KINDS = {
    "jpg": {"quality": 90},
    "png": {"compress_level": 1},
    "tif": {},
    "lzw.tif": {"compression": "tiff_lzw"},
    "bmp": {},
}


def main() -> int:
    if len(sys.argv) > 1:
        before, began = peak_mib(), time.perf_counter()
        picture = read_picture(Path(sys.argv[1]))
        height, width = picture.bgr.shape[:2]
        print(f"{width} x {height} | {time.perf_counter() - began:.1f} | {peak_mib() - before:.0f}", end="")
        return 0
    picture = Image.effect_noise((255, 255), 60).resize(SIZE, Image.Resampling.BICUBIC).convert("RGB")
    print(f"{SIZE[0]} x {SIZE[1]} pixels\n\n| file | read as | seconds | MiB more at the peak |")
    print("| --- | --- | ---: | ---: |")
    for ending, options in KINDS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"a.{ending}"
            picture.save(path, **options)  # type: ignore[arg-type]
            command = [sys.executable, __file__, str(path)]
            said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        print(f"| .{ending} | {said} |", flush=True)
    return 0


def peak_mib() -> float:
    # Of this program alone: ru_maxrss also has what the one before exec() needed.
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024


if __name__ == "__main__":
    sys.exit(main())
