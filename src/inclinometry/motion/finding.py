"""One thing found in a window of a run, in the words of the result's flags."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """What a check found.

    flag : a name of `inclinometry.motion.result.FLAGS`.
    where : channel or triad, e.g. "accel_x", "mag".
    share : the statistic over its limit, above 1.
    refuse : whether a window with it must not be used by a method that needs `where`.
    text : a sentence for the user.
    """

    flag: str
    where: str
    share: float
    refuse: bool
    text: str
