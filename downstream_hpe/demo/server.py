# SPDX-License-Identifier: MIT
"""The page on this machine's loopback, for nobody else."""

from __future__ import annotations

import errno
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from downstream_hpe.errors import UsageError

LOOPBACK = "127.0.0.1"
HEADERS = {
    # The page says more in its own policy, which holds on any host.
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Permissions-Policy": "camera=(self), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}


class _Server(ThreadingHTTPServer):
    request_queue_size = 64  # a browser asks for all modules at once


class _Handler(SimpleHTTPRequestHandler):
    extensions_map = {  # noqa: RUF012 -- as in the class it replaces
        **SimpleHTTPRequestHandler.extensions_map,
        # A system may call these something else, and a browser then refuses them.
        ".js": "text/javascript",
        ".mjs": "text/javascript",
        ".wasm": "application/wasm",
        ".json": "application/json",
        ".txt": "text/plain; charset=utf-8",
    }

    def end_headers(self) -> None:
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def list_directory(self, path: Any) -> None:
        self.send_error(404)

    def log_message(self, format: str, *values: Any) -> None:
        """Nothing: who looks at the page is nobody's business."""


def open_server(folder: Path, port: int) -> ThreadingHTTPServer:
    """A server of the folder's files; close it with server_close. port: 0 for any that is free.

    UsageError: the port is taken, or not this user's to take.
    """
    try:
        return _Server((LOOPBACK, port), partial(_Handler, directory=str(folder)))
    except OSError as error:
        taken = error.errno in (errno.EADDRINUSE, getattr(errno, "WSAEADDRINUSE", errno.EADDRINUSE))
        reason = "in use by another program" if taken else f"not to be had ({error.strerror})"
        raise UsageError(f"--port {port}: {reason}; give another one, or 0 for any that is free") from error
