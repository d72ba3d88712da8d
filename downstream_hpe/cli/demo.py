# SPDX-License-Identifier: MIT
"""What ``downstream-hpe demo`` does with its options."""

from __future__ import annotations

import json
import tempfile
import threading
import time
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.cli.console import JsonFlag, note, say


def demo(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for any that is free.")] = 8765,
    write: Annotated[
        Path | None, typer.Option(help="Write the page into this folder, for a static host, and end.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Head pose in your browser: camera, pictures, videos. Nothing leaves this machine; Ctrl-C ends it."""
    from downstream_hpe.demo.folder import write_page
    from downstream_hpe.demo.server import LOOPBACK, open_server

    if write is not None:
        size = write_page(write, note=note)
        say(json.dumps({"folder": str(write), "bytes": size}) if as_json else _written(write, size))
        return
    with tempfile.TemporaryDirectory(prefix="headturn-demo-") as scratch:
        folder = Path(scratch)
        with open_server(folder, port) as server:
            write_page(folder, note=note)
            url = f"http://{LOOPBACK}:{server.server_address[1]}/"
            # In a thread, so that Ctrl-C never meets it in the middle of an answer.
            serving = threading.Thread(target=server.serve_forever, daemon=True)
            serving.start()
            try:
                say(json.dumps({"url": url}) if as_json else f"{url} is the page, for this machine alone")
                note("Ctrl-C ends it")
                while serving.is_alive():
                    time.sleep(1)
            except KeyboardInterrupt:
                note("ended")
            server.shutdown()


def _written(folder: Path, size: int) -> str:
    return f"{folder}: {size / 1e6:.0f} MB for any static host; a camera needs https:// there"
