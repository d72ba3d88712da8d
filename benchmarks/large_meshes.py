# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading scans of millions of triangles: seconds of processor time and memory, beside trimesh's own loader.

    python benchmarks/large_meshes.py [MILLIONS ...]     1 and 3.6 without

A bumpy ball with a texture is written as OBJ and as binary PLY, and each is read in a process of its own,
whose processor time and largest memory count, less what it took before it began. Linux alone.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from PIL import Image
from pyarrow import csv

SIZES = (1.0, 3.6)


def ball(triangles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """float64 [V, 3] in millimetres, float64 [V, 2] and int64 [T, 3] of a grid around a bumpy ball."""
    rows = int(np.sqrt(triangles / 4))
    v, u = np.mgrid[0 : 1 : (rows + 1) * 1j, 0 : 1 : (2 * rows + 1) * 1j]
    polar, around = (0.02 + 0.96 * v) * np.pi, 2 * np.pi * u
    radius = 100 + np.sin(40 * around) * np.sin(40 * polar)
    towards = [np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)]
    points = np.stack([radius * axis for axis in towards], axis=-1)
    index = np.arange(points[..., 0].size).reshape(points.shape[:2])
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    return points.reshape(-1, 3), np.stack([u, 1 - v], axis=-1).reshape(-1, 2), faces


def write(folder: Path, millions: float) -> list[Path]:
    """head.obj and head.ply, with head.png."""
    points, uv, faces = ball(round(millions * 1e6))
    Image.new("RGB", (1024, 1024), (200, 150, 130)).save(folder / "head.png")
    (folder / "head.mtl").write_text("newmtl skin\nmap_Kd head.png\n")
    rows = csv.WriteOptions(include_header=False, delimiter=" ", quoting_style="none")
    corner = pc.cast(pa.array(np.arange(1, len(points) + 1)), pa.string())
    corner = pc.binary_join_element_wise(corner, corner, "/")
    with (folder / "head.obj").open("wb") as file:
        file.write(b"mtllib head.mtl\nusemtl skin\n")
        for key, columns in (
            ("v", points.round(5).T),
            ("vt", uv.round(6).T),
            ("f", [corner.take(pa.array(column)) for column in faces.T]),
        ):
            names = [key, *map(str, range(len(columns)))]
            csv.write_csv(pa.table([pa.array([key] * len(columns[0])), *columns], names), file, rows)
    vertex = [(name, "<f4") for name in ("x", "y", "z", "s", "t")]
    packed = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    packed["count"], packed["corners"] = 3, faces
    header = ["ply", "format binary_little_endian 1.0", "comment TextureFile head.png"]
    header += [f"element vertex {len(points)}", *(f"property float {name}" for name, _ in vertex)]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    with (folder / "head.ply").open("wb") as file:
        file.write("\n".join([*header, ""]).encode())
        file.write(np.column_stack([points, uv]).astype("<f4").tobytes())
        file.write(packed.tobytes())
    return [folder / "head.obj", folder / "head.ply"]


def ours(path: Path) -> int:
    """Triangles that Headturn reads."""
    from generator.heads.read import read_mesh
    from generator.heads.source import find_heads

    (head,) = find_heads(path).heads
    with tempfile.TemporaryDirectory() as scratch:
        return len(read_mesh(head, Path(scratch)).triangles)


def trimesh(path: Path) -> int:
    """Triangles that trimesh reads."""
    import trimesh

    return len(trimesh.load(path, process=False, force="mesh").faces)


READERS: dict[str, Callable[[Path], int]] = {"headturn": ours, "trimesh": trimesh}


def peak_mib() -> float:
    """The most memory this process had; unlike the one of getrusage it does not begin with its parent's."""
    with open("/proc/self/status", encoding="ascii") as file:
        return int(next(line for line in file if line.startswith("VmHWM")).split()[1]) / 1024


def measure(reader: str, path: Path) -> None:
    """Print what reading a file takes, as JSON."""
    import trimesh

    import generator.heads.read

    assert generator.heads.read and trimesh, "imported before the clock starts"
    before, start = peak_mib(), time.process_time()
    triangles = READERS[reader](path)
    seconds = time.process_time() - start
    print(json.dumps({"triangles": triangles, "seconds": seconds, "mib": peak_mib() - before}))


def main() -> int:
    if sys.argv[1:2] == ["--read"]:
        measure(sys.argv[2], Path(sys.argv[3]))
        return 0
    for millions in map(float, sys.argv[1:] or SIZES):
        with tempfile.TemporaryDirectory(prefix="headturn-large-") as folder:
            for path in write(Path(folder), millions):
                for reader in READERS:
                    command = [sys.executable, __file__, "--read", reader, str(path)]
                    done = subprocess.run(command, capture_output=True, text=True, check=True)
                    found = json.loads(done.stdout)
                    what = f"{path.suffix[1:]} of {found['triangles']:,} triangles"
                    size = path.stat().st_size / 2**20
                    taken = f"{found['seconds']:.1f} s, {found['mib']:.0f} MiB"
                    print(f"{what}, {size:.0f} MiB: {reader} {taken}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
