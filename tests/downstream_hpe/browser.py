# SPDX-License-Identifier: GPL-3.0-or-later
"""A headless Chromium that a test drives: the DevTools protocol through two pipes, which needs no library."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--hide-scrollbars", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-extensions", "--remote-debugging-pipe",
)  # fmt: skip
PATIENCE_S = 150.0
LOOK_S = 0.03


class Browser:
    """One tab. console: what the page wrote there. requests: every address that it asked for.

    options: further flags of Chromium. folder: for its profile.
    """

    def __init__(self, folder: Path, *options: str) -> None:
        found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
        if found is None:
            pytest.skip("no Chromium on this machine; `sh scripts/test_browser.sh` installs Debian's")
        theirs_in, self._to = os.pipe()
        self._from, theirs_out = os.pipe()

        def give_pipes() -> None:
            # It reads orders from descriptor 3 and answers on 4, which may be others of ours until here.
            kept = os.dup(theirs_in), os.dup(theirs_out)
            os.dup2(kept[0], 3)
            os.dup2(kept[1], 4)

        self._process = subprocess.Popen(
            [found, *FLAGS, f"--user-data-dir={folder / 'profile'}", *options],
            preexec_fn=give_pipes,
            pass_fds=(3, 4),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._rest, self._count = b"", 0
        self.console: list[str] = []
        self.requests: list[str] = []
        self._session = ""
        target = self.order("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.order("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "DOM", "Log"):
            self.order(f"{domain}.enable")

    def order(self, method: str, **values: Any) -> dict[str, Any]:
        """One command of the protocol, and its answer."""
        self._count += 1
        order: dict[str, Any] = {"id": self._count, "method": method, "params": values}
        if self._session:
            order["sessionId"] = self._session
        os.write(self._to, json.dumps(order).encode() + b"\0")
        until = time.monotonic() + PATIENCE_S
        while True:
            message = self._message(until)
            if message.get("id") == self._count:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def open(self, address: str, width: int = 1280, height: int = 900) -> None:
        """Go to a page, in a window of so many pixels."""
        self.resize(width, height)
        self.order("Page.navigate", url=address)

    def resize(self, width: int, height: int) -> None:
        """Have a window of so many pixels; a narrow one is a telephone's."""
        self.order(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip

    def run(self, script: str) -> Any:
        """The value of an expression on the page; a promise is waited for."""
        found = self.order("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait(self, script: str, looks: int = 3000) -> Any:
        """The first value of an expression that counts as true.

        looks: so often it is looked at; a machine that stood still in between has not waited.
        """
        for _ in range(looks):
            if value := self.run(script):
                return value
            time.sleep(LOOK_S)
        raise AssertionError((script, self.run("document.body.innerText"), self.console))

    def choose(self, selector: str, *files: Path) -> None:
        """Give files to a chooser of files."""
        root = self.order("DOM.getDocument")["root"]["nodeId"]
        node = self.order("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.order("DOM.setFileInputFiles", nodeId=node, files=[str(file) for file in files])

    def drop(self, *files: Path) -> None:
        """Drag files onto the page, and let go of them."""
        data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.order("Input.dispatchDragEvent", type=kind, x=100, y=200, data=data)

    def screenshot(self, path: Path) -> None:
        """What is seen."""
        path.write_bytes(base64.b64decode(self.order("Page.captureScreenshot", format="png")["data"]))

    def _message(self, until: float) -> dict[str, Any]:
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._from], [], [], max(0.0, until - time.monotonic()))
            assert ready, "the browser does not answer"
            part = os.read(self._from, 1 << 20)
            assert part, "the browser ended"
            self._rest += part
        first, _, self._rest = self._rest.partition(b"\0")
        return json.loads(first)

    def _note(self, message: dict[str, Any]) -> None:
        values = message.get("params", {})
        if message.get("method") == "Runtime.consoleAPICalled":
            self.console.append(
                f"{values['type']}: {[a.get('value', a.get('description')) for a in values['args']]}"
            )
        elif message.get("method") == "Runtime.exceptionThrown":
            self.console.append(f"exception: {values['exceptionDetails']}")
        elif message.get("method") == "Log.entryAdded":
            self.console.append(f"{values['entry']['level']}: {values['entry']['text']}")
        elif message.get("method") == "Network.requestWillBeSent":
            self.requests.append(values["request"]["url"])

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._to)
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._from)
