# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of ``downstream-hpe demo`` beside Python, on the same pictures, in headless Chromium.

    python benchmarks/demo_page.py PICTURE ...

Prints by how much yaw, pitch, roll and confidence differ, on how many pictures one alone finds a face,
and how many frames a second the page looks at when a camera of 30 shows the first picture. Fails beyond 0.1
degrees.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import threading
import time
from pathlib import Path

import cv2
import numpy as np

from downstream_hpe.demo.folder import write_page
from downstream_hpe.demo.server import LOOPBACK, open_server
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.predictor import Predictor

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "downstream_hpe"))
from browser import Browser

LIMIT_DEG = 0.1
SECONDS = 5
READY = "document.body?.dataset.state === 'ready'"
COUNT = """window.frames_seen = 0; new MutationObserver(() => window.frames_seen++).observe(
    document.getElementById("numbers"), { attributes: true }); 0"""


def on_page(browser: Browser, picture: Path) -> np.ndarray | None:
    """Yaw, pitch, roll and confidence; None without a face."""
    browser.choose("#file", picture)
    name = json.dumps(f"{picture.name}: ")
    browser.wait(f"{READY} && document.getElementById('status').textContent.startsWith({name})")
    said = browser.run("document.getElementById('numbers').dataset.pose")
    return np.array(json.loads(said)) if said else None


def main() -> int:
    """Compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("pictures", type=Path, nargs="+", metavar="PICTURE")
    pictures = parser.parse_args().pictures
    predictor, differences, alone = Predictor.load(), [], []
    with tempfile.TemporaryDirectory() as scratch:
        folder, camera = Path(scratch) / "page", Path(scratch) / "camera.y4m"
        write_page(folder)
        frame = cv2.resize(read_bgr(pictures[0]), (640, 480))
        with camera.open("wb") as file:
            file.write(b"YUV4MPEG2 W640 H480 F30:1 Ip A1:1 C420jpeg\n")
            file.write((b"FRAME\n" + cv2.cvtColor(frame, cv2.COLOR_BGR2YUV_I420).tobytes()) * 30)
        flags = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
        with (
            open_server(folder, 0) as server,
            Browser(Path(scratch), *flags, f"--use-file-for-fake-video-capture={camera}") as browser,
        ):
            threading.Thread(target=server.serve_forever, daemon=True).start()
            browser.open(f"http://{LOOPBACK}:{server.server_address[1]}/")
            browser.wait(READY)
            for picture in pictures:
                page, pose = on_page(browser, picture), predictor.from_image(read_bgr(picture))
                if page is None or pose is None:
                    alone += [picture] * ((page is None) != (pose is None))
                    continue
                differences.append(np.abs(page - [*pose.ypr_deg[0], pose.confidence[0]]))
            browser.run("document.getElementById('camera').click()")
            browser.wait("document.body.dataset.state === 'playing'")
            browser.run(COUNT)
            time.sleep(SECONDS)
            rate = browser.run("frames_seen") / SECONDS
            server.shutdown()
    every = np.array(differences).reshape(-1, 4)
    print(f"{len(pictures)} pictures, a face in {len(every)} by both, by one alone in {len(alone)}")
    for name, column in zip(("yaw", "pitch", "roll", "confidence"), every.T, strict=True):
        print(f"{name}: mean difference {column.mean():.4f}, largest {column.max():.4f}")
    print(f"a camera of 640 x 480: {rate:.1f} frames a second")
    return int(bool(alone) or not len(every) or bool(every[:, :3].max() > LIMIT_DEG))


if __name__ == "__main__":
    sys.exit(main())
