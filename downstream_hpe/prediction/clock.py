# SPDX-License-Identifier: MIT
"""The times of a video's frames, which rise."""

from __future__ import annotations


class RisingClock:
    """Of one video. step_s: between frames, where they have no times. last_s: of the latest frame, None
    before the first; longest_s: the longest time between two."""

    def __init__(self, origin_s: float | None, step_s: float) -> None:
        self._origin_s, self._step_s = origin_s, step_s
        self.last_s: float | None = None
        self.longest_s = step_s

    def __call__(self, stamp_s: float | None) -> float:
        """The time of the next frame by its stamp, from the origin on, or from the first frame.

        A stamp that does not rise is of a stream that began anew, or of a damaged file: time goes on.
        """
        if self._origin_s is None:
            self._origin_s = 0.0 if stamp_s is None else stamp_s
        time_s = None if stamp_s is None else stamp_s - self._origin_s
        if self.last_s is not None and (time_s is None or time_s <= self.last_s):
            following = self.last_s + self._step_s
            if time_s is not None:
                self._origin_s -= following - time_s
            time_s = following
        time_s = 0.0 if time_s is None else round(time_s, 6)
        if self.last_s is not None:
            self.longest_s = max(self.longest_s, time_s - self.last_s)
        self.last_s = time_s
        return time_s
