# SPDX-License-Identifier: GPL-3.0-or-later
"""What a worker asks of the operating system."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from generator.process import available_cores, few_cores

linux = pytest.mark.skipif(sys.platform != "linux", reason="cores are given to processes on Linux alone")


@linux
def test_cores_are_few_in_a_block_and_all_after_it_in_every_thread() -> None:
    before, done = available_cores(), threading.Event()
    with few_cores(1):
        assert available_cores() == before[:1]
        began = threading.Thread(target=done.wait)
        began.start()
    try:
        for thread in os.listdir("/proc/self/task"):
            assert sorted(os.sched_getaffinity(int(thread))) == before
    finally:
        done.set()
        began.join()
    with few_cores(0):
        assert available_cores() == before
