"""A filter that is only run where it is wanted: the windows before are kept, and it catches up with them first."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from inclinometry.core.errors import IdentifiabilityError
from inclinometry.motion.result import Attitude
from inclinometry.motion.samples import Samples

KEPT_S: Final = 120.0
"""s of a run that are kept to catch up with: the filter's bias and scale have settled after that."""
MOST_KEPT: Final = 500_000
"""Samples kept at most."""


class Stream(Protocol):
    """What every recursive method is."""

    def push(self, samples: Samples) -> Attitude:
        """Rows that became complete."""
        ...

    def finish(self) -> Attitude:
        """The last rows, and what was found."""
        ...


class Standby:
    """A stream of whole windows that sleeps while nobody wants its rows.

    Parameters
    ----------
    make : callable
        A fresh stream that gives one row a window.
    """

    def __init__(self, make: Callable[[], Stream]) -> None:
        self._make = make
        self._kept: deque[tuple[bool, Samples]] = deque()
        self._stream: Stream | None = None
        self._unwanted = 0

    def restart(self) -> None:
        """A gap: nothing of before holds for what comes."""
        self._kept.clear()
        self._stream = None

    def take(self, window: Samples, *, good: bool, wanted: bool) -> Attitude | None:
        """The window's row where it is wanted; None where there is none.

        Parameters
        ----------
        window : Samples
        good : bool
            Whether it could be started from.
        wanted : bool
        """
        self._unwanted = 0 if wanted else self._unwanted + 1
        if self._stream is not None and _many(window, self._unwanted):
            self._stream = None  # what is kept now catches up as well
        self._keep(window, good=good)
        if self._stream is not None:
            row = self._pushed(window)
            return row if wanted else None
        row = None
        if wanted and self._kept:
            self._stream = self._make()
            for _, one in self._kept:
                row = self._pushed(one)
        return row

    def _pushed(self, window: Samples) -> Attitude | None:
        """Row of a window; a filter that cannot start is given up."""
        if self._stream is None:
            return None
        try:
            found = self._stream.push(window)
        except IdentifiabilityError:
            self._stream = None
            return None
        return found if len(found) == 1 else None

    def _keep(self, window: Samples, *, good: bool) -> None:
        """The newest windows; the first of them is one to start from."""
        self._kept.append((good, window))
        while _many(window, len(self._kept)):
            self._kept.popleft()
        while self._kept and not self._kept[0][0]:
            self._kept.popleft()


def _many(window: Samples, count: int) -> bool:
    """Whether so many windows are more than are kept."""
    return count > 1 and (len(window) * count > MOST_KEPT or len(window) * count * window.interval > KEPT_S)


def single(rows: Attitude | None) -> bool:
    """Whether there is a row with an attitude."""
    return rows is not None and len(rows) == 1 and not bool(np.isnan(rows.quaternion[0, 0]))
