"""What the rig is doing, asked for all browsers at once and never by the page's own thread: a rig may answer late."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry.core.errors import InclinometryError
from inclinometry.io.instrument.rig import ManualRig, rig_driver
from inclinometry.workflow.laboratory.registry import RegisteredRig

if TYPE_CHECKING:
    from inclinometry.io.instrument.rig import RigDriver

NEAR: Final = float(np.radians(0.25))
"""A rig this near to a setting, rad, has been turned to it."""
FRESH: Final = 0.25
"""s for which an answer of the rig is good for every browser."""


@dataclass(frozen=True)
class RigState:
    """word : "ready", "moving" or "lost"; setting : where it stands, rad, None when not known; reason : why lost."""

    word: str
    setting: tuple[float, float, float] | None = None
    reason: str = ""

    def at(self, dial: tuple[float, float, float]) -> bool:
        """Whether it stands at this setting.

        Examples
        --------
        >>> RigState("ready", (0.0, 1.0, 0.0)).at((2 * np.pi, 1.0, 0.0)), RigState("moving").at((0.0, 0.0, 0.0))
        (True, False)
        """
        if self.word != "ready" or self.setting is None:
            return False
        apart = (np.subtract(dial, self.setting) + np.pi) % (2.0 * np.pi) - np.pi
        return bool(np.abs(apart).max() <= NEAR)


class RigWatch:
    """Asks a motorised rig how it stands, at most four times a second however many ask; `settled` is called when it
    has come to rest."""

    def __init__(self, rig: RigDriver, settled: Callable[[], None]) -> None:
        self._rig, self._settled = rig, settled
        self._asked = float("-inf")
        self.state = RigState("moving")

    def poll(self) -> RigState:
        """The state as of now; may take as long as the rig takes to answer."""
        now = time.monotonic()
        if now - self._asked < FRESH:
            return self.state
        self._asked = now
        before = self.state.word
        try:
            self.state = RigState("ready", self._rig.position()) if self._rig.ready() else RigState("moving")
        except (InclinometryError, OSError) as error:
            self.state = RigState("lost", reason=str(error))
        if self.state.word == "ready" and before != "ready":
            self._settled()
        return self.state

    def move(self, dial: tuple[float, float, float]) -> None:
        """Turn the rig; errors as its driver's."""
        self._rig.move(*dial)
        self.state, self._asked = RigState("moving"), float("-inf")


_DRIVERS: dict[str, tuple[Mapping[str, Any], RigDriver]] = {}


def driver_of(rig: RegisteredRig) -> RigDriver | None:
    """The driver a registered rig names, one a process; None for a rig without one.

    Raises
    ------
    InputError
        A driver that cannot be made of what is registered.
    """
    if not rig.driver:
        return None
    known = _DRIVERS.get(rig.name)
    if known is None or known[0] != rig.driver:
        known = (dict(rig.driver), rig_driver(rig.driver, rig.name))
        _DRIVERS[rig.name] = known
    return known[1]


_WATCHES: weakref.WeakKeyDictionary[RigDriver, RigWatch] = weakref.WeakKeyDictionary()


def watch_of(rig: RigDriver | None, settled: Callable[[], None]) -> RigWatch | None:
    """The one watch of a motorised rig; None for a rig turned by hand, which only its operator knows the setting of."""
    if rig is None or isinstance(rig, ManualRig):
        return None
    if rig not in _WATCHES:
        _WATCHES[rig] = RigWatch(rig, settled)
    return _WATCHES[rig]
