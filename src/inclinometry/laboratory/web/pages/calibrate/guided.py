"""What one browser's bench page knows and does; how it looks is in the modules beside it."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from inclinometry.arrays import Array
from inclinometry.calibration.design import NextPosition
from inclinometry.constants import COVERAGE_FACTOR
from inclinometry.errors import InclinometryError, InputError, refused
from inclinometry.findings import Finding
from inclinometry.laboratory import drift
from inclinometry.laboratory.attitude import Judge, OffTarget, at_target, off_target
from inclinometry.laboratory.instruments.rig import ManualRig, rig_driver
from inclinometry.laboratory.ledger.ledger import Record
from inclinometry.laboratory.live import LiveFeed, Stability
from inclinometry.laboratory.progress import Progress, goal_of, judge_of, proposal, session_progress
from inclinometry.laboratory.registry import RegisteredRig, find_rig, rig_of
from inclinometry.laboratory.results import earlier_judge
from inclinometry.laboratory.session import (
    Capture,
    Position,
    RecordedReading,
    Session,
    capture,
    close_session,
    dial_at,
    load_session,
    reject,
)
from inclinometry.laboratory.web.frame import Visitor
from inclinometry.rotations import dcm

if TYPE_CHECKING:
    from inclinometry.laboratory.instruments.rig import RigDriver

LENGTH, RADIUS, NOSE = 0.82, 0.15, 0.30
RING, NORTH, COLLAR = 1.0, 1.28, 0.34
_TURN: Final = np.linspace(0.0, 2.0 * np.pi, 49)


def _eye() -> Array:
    """(3, 3) north, east, down -> right, up, toward the eye."""
    # the picture is seen from the south-south-east and from above
    a, h = np.radians(155.0), np.radians(24.0)
    toward = np.array([np.cos(a) * np.cos(h), np.sin(a) * np.cos(h), -np.sin(h)])
    right = np.cross(-toward, [0.0, 0.0, -1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, -toward), toward])


_EYE: Final = _eye()


def project(points: Array) -> Array:
    """Points (n, 3) north, east, down -> (n, 3) x right, y downward in the picture's units, depth to the eye."""
    scale = 100.0
    seen = np.asarray(points, dtype=float).reshape(-1, 3) @ _EYE.T
    return np.stack([scale * seen[:, 0], -scale * seen[:, 1], seen[:, 2]], axis=1)


def drawing(dial: tuple[float, float, float], label: str, words: tuple[str, str]) -> str:
    """The picture of a setting, rad, as SVG; label and words ("N" and "down" in the reader's language) come escaped."""
    azimuth, inclination, toolface = dial
    x, _, z = axes = dcm(*dial)  # x: the index mark, z: toward the bit; in north, east, down
    high = dcm(azimuth, inclination, 0.0)
    heading = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    north, down = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    level = _arc(north, np.array([0.0, 1.0, 0.0]), _TURN)
    upright = _arc(down, heading, _TURN)
    collar = -0.45 * z + COLLAR * _arc(high[0], high[1], _TURN)
    back, front = [], []
    for ring in (level, upright, collar):
        # the stretches of a ring behind and before its centre
        near = project(ring)[:, 2] >= project(ring.mean(axis=0))[0, 2]
        halves: tuple[list[Array], list[Array]] = ([], [])
        begin = 0
        for i in range(1, len(ring)):
            if near[i] != near[begin] or i == len(ring) - 1:
                halves[int(near[begin])].append(ring[begin : i + 1])
                begin = i
        back.append(_path(halves[0], "ring far"))
        front.append(_path(halves[1], "ring"))
    angles = [
        _path([_arc(north, np.array([0.0, 1.0, 0.0]), _sweep(azimuth))], "angle"),
        _path([_arc(down, heading, _sweep(inclination))], "angle"),
        _path([-0.45 * z + COLLAR * _arc(high[0], high[1], _sweep(toolface))], "angle"),
    ]
    fixed = _arrow(north * NORTH, "north", words[0]) + _arrow(down * NORTH, "down", words[1])
    # the index mark: a stripe along the tool and a pin; dashed where the tool hides it
    stripe = RADIUS * x + np.stack([-(LENGTH - 0.04) * z, (LENGTH - NOSE) * z])
    pin = np.stack([RADIUS * x - 0.45 * z, (COLLAR + 0.06) * x - 0.45 * z])
    hidden = "" if (_EYE @ x)[2] > -1e-9 else " hidden"
    body = _tool(axes) + (_path([stripe], f"mark{hidden}") + _path([pin], "pin"))
    size = 'viewBox="-190 -135 380 275" preserveAspectRatio="xMidYMid meet"'
    inside = "".join([*back, fixed, body, *front, *angles])
    return f'<svg class="stand" role="img" aria-label="{label}" {size}>{inside}</svg>'


def _sweep(angle: float) -> Array:
    """From zero to an angle the short way round for negative ones, in small steps."""
    return np.linspace(0.0, angle, max(2, int(abs(angle) / 0.06) + 2))


def _arc(first: Array, second: Array, angle: Array) -> Array:
    return RING * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second)


def _points(seen: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in seen[:, :2])


def _path(lines: Iterable[Array], name: str) -> str:
    return "".join(f'<polyline class="{name}" points="{_points(project(line))}"/>' for line in lines)


def _arrow(tip: Array, name: str, word: str) -> str:
    ends = project(np.stack([np.zeros(3), tip, 1.13 * tip]))
    along = ends[1, :2] - ends[0, :2]
    along /= np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    head = np.stack([ends[1, :2], ends[1, :2] - 11 * along + 5 * across, ends[1, :2] - 11 * along - 5 * across])
    line = f'<polyline class="{name}" points="{_points(ends[:2])}"/>'
    text = f'<text class="{name}" x="{ends[2, 0]:.1f}" y="{ends[2, 1] + 4:.1f}">{word}</text>'
    return f'{line}<polygon class="{name}" points="{_points(head)}"/>{text}'


def _tool(axes: Array) -> str:
    """A cylinder with a nose toward the bit, drawn from far to near."""
    x, y, z = axes
    circle = RADIUS * (np.cos(_TURN)[:, None] * x + np.sin(_TURN)[:, None] * y)
    top, shoulder, tip = circle - LENGTH * z, circle + (LENGTH - NOSE) * z, LENGTH * z[None]
    barrel = f'<polygon class="barrel" points="{_points(_hull(np.concatenate([top, shoulder])))}"/>'
    nose = f'<polygon class="nose" points="{_points(_hull(np.concatenate([shoulder, tip])))}"/>'
    if (_EYE @ z)[2] > 0.0:  # the nose points toward the eye
        return barrel + nose
    return f'{nose}{barrel}<polygon class="cap" points="{_points(project(top))}"/>'


def _hull(points: Array) -> Array:
    """Convex outline of projected points, (k, 2); Andrew's chain."""
    flat = sorted({(round(float(a), 2), round(float(b), 2)) for a, b in project(points)[:, :2]})
    chains: list[list[tuple[float, float]]] = []
    for order in (flat, flat[::-1]):
        chain: list[tuple[float, float]] = []
        for p in order:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (p[1] - ay) > (by - ay) * (p[0] - ax):
                    break
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


# What the rig is doing, asked for all browsers at once and never by the page's own thread: a rig may answer late.


@dataclass(frozen=True)
class RigState:
    """word : "ready", "moving" or "lost"; setting : where it stands, rad, None when not known; reason : why lost."""

    word: str
    setting: tuple[float, float, float] | None = None
    reason: Finding | None = None

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
        # a rig this near to a setting, rad, has been turned to it
        return bool(np.abs(apart).max() <= float(np.radians(0.25)))


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
        # s for which an answer of the rig is good for every browser
        if now - self._asked < 0.25:
            return self.state
        self._asked = now
        before = self.state.word
        try:
            self.state = RigState("ready", self._rig.position()) if self._rig.ready() else RigState("moving")
        except (InclinometryError, OSError) as error:
            self.state = RigState("lost", reason=getattr(error, "finding", None))
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


# A temperature campaign at the stand: whether the tool has reached its target and is even inside.


@dataclass(frozen=True)
class Heat:
    """measured : degC now; rate : degC a minute, NaN when not known yet; even, near : as named."""

    measured: float
    rate: float
    even: bool
    near: bool


def heat_of(feed: LiveFeed | None, target: float) -> Heat | None:
    """How the temperature stands against a target in degC; None for an instrument that sends none."""
    if feed is None:
        return None
    # s over which the drift of the temperature is looked at
    window = feed.window(60.0)
    good = np.isfinite(window.temperature)
    if not good.any():
        return None
    time, temperature = window.time[good], window.temperature[good]
    now = float(temperature[-10:].mean())
    rate = float("nan")
    least = 10.0
    if time[-1] - time[0] >= least:
        rate = 60.0 * float(np.polyfit(time - time[0], temperature, 1)[0])
    # degC a minute; a tool that warms slower is even inside to a few tenths of a degree
    # degC from the target; the fit uses what was measured, so that nearness only spreads the range well
    return Heat(now, rate, bool(abs(rate) <= 0.2), bool(abs(now - target) <= 3.0))


class Guided:
    """A session as one browser works on it, as the ledger has it when `reload` was called last.

    chosen : the position on the large card. now, place : the running fit and the position it proposes; None before the
        first, and in a verification.
    automatic : capture by itself when the tool has moved and stands still.
    turner : the watch of a motorised rig; None for one turned by hand.
    """

    def __init__(self, visitor: Visitor, session: str) -> None:
        self.visitor = visitor
        self.ledger, self.feed = visitor.bench.ledger, visitor.bench.feed
        self.session: Session = load_session(self.ledger, session)
        self.goal = goal_of(self.ledger, self.session)
        found = rig_of(self.ledger, self.session.id)
        # a session cannot be opened without its rig, and records are never removed
        self.about_rig: RegisteredRig = found if found is not None else RegisteredRig(self.session.rig, (0.0, 0.0, 0.0))
        today = find_rig(self.ledger, self.session.rig) or self.about_rig
        self.rig = visitor.bench.rig if visitor.bench.rig is not None else driver_of(today)
        self.turner: RigWatch | None = watch_of(self.rig, (lambda: None) if self.feed is None else self.feed.moved)
        self.now: Progress | None = None
        self.place: NextPosition | None = None
        self.automatic = False
        self._moved = True
        self._asked = 0  # the position of which a capture was asked since the tool moved last
        self.retakes = False  # a position that was captured has been chosen again
        self._known = self._mark()
        self._earlier = earlier_judge(self.ledger, self.session)
        self.chosen: Position = self.session.next or self.positions[-1]

    @property
    def adaptive(self) -> bool:
        """Whether the plan is made while it is run."""
        return bool(self.session.settings.get("settings", {}).get("adaptive"))

    @property
    def verifies(self) -> bool:
        """Whether the readings are to judge a calibration, not to make one."""
        return self.session.purpose == "verify"

    @property
    def wants(self) -> bool:
        """Whether an uncertainty was agreed that is not reached yet."""
        stated = self.goal.u_azimuth is not None or self.goal.u_inclination is not None
        return stated and self.now is not None and not self.now.reached

    @property
    def positions(self) -> tuple[Position, ...]:
        """The plan, then positions that were added, then the one proposed."""
        planned = {p.number: p for p in self.session.positions}
        added = {n: Position(n, t.capture.dial) for n, t in self.session.taken.items() if n not in planned}
        every = {**planned, **added}
        if self.place is not None and self.session.next is None and not self.session.closed:
            dial = dial_at(self.session.dials, self.place.azimuth, self.place.inclination, self.place.toolface)
            every[max(every) + 1] = Position(max(every) + 1, dial)
        return tuple(every[n] for n in sorted(every))

    @property
    def proposed(self) -> int | None:
        """Number of the position that is proposed beyond the plan; None when there is none."""
        last = self.positions[-1].number
        return last if self.place is not None and last not in self.session.taken else None

    @property
    def open_positions(self) -> tuple[Position, ...]:
        """What is still to be captured: the plan, and the proposed one where a plan goes on by itself."""
        goes_on = self.adaptive or self.wants
        missing = [p for p in self.positions if not self.session.has(p.number)]
        return tuple(p for p in missing if p.number != self.proposed or goes_on)

    @property
    def judged_by(self) -> Judge | None:
        """The calibration that turns channels into angles."""
        return judge_of(self._earlier, self.now)

    def off_now(self, seen: Stability) -> OffTarget | None:
        """The tool as it stands now, against the target; None where no calibration tells."""
        by = self.judged_by
        if by is None or self.feed is None or not seen.mean:
            return None
        units = self.feed.protocol.units
        here = Capture(seen.mean, self.chosen.dial, seen.count, units=units, temperature=seen.temperature)
        return off_target(by, self.session, self.about_rig.sd, here)

    def gain(self) -> tuple[float, float] | None:
        """Expanded uncertainty of the goal's angle now and after the proposed position, rad; None when not known."""
        if self.place is None or self.goal.criterion == "trace":
            return None
        before, after = self.place.before, self.place.value
        shown = float("nan") if self.now is None else getattr(self.now, f"u_{self.goal.criterion}")
        if self.now is not None and np.isfinite(shown) and np.isfinite(before):
            noise = self.now.noise[("inclination", "azimuth").index(self.goal.criterion)]
            # only the calibration's share shrinks
            share = max(shown**2 - noise**2, 0.0) * (after / before) ** 2
            return shown, float(np.sqrt(share + noise**2))
        return (COVERAGE_FACTOR * before, COVERAGE_FACTOR * after) if np.isfinite(after) else None

    def target_temperature(self, number: int) -> float | None:
        """degC a position of a temperature campaign is to be captured at; None without a campaign."""
        targets = self.session.settings.get("settings", {}).get("target_degC", [])
        return float(targets[number - 1]) if 1 <= number <= len(targets) else None

    def heat(self) -> Heat | None:
        """The temperature against the target of the chosen position; None where there is no target."""
        target = self.target_temperature(self.chosen.number)
        return None if target is None else heat_of(self.feed, target)

    def reload(self) -> None:
        """Read the session again: another browser may have captured something."""
        self.session = load_session(self.ledger, self.session.id)

    def news(self) -> bool:
        """Read the session again; whether another browser has changed it.

        A page whose position has just been captured elsewhere goes on to the next, without turning the rig.
        """
        mark = self._mark()
        if mark == self._known:
            return False
        self._known, before = mark, self.session
        self.reload()
        if self.session.has(self.chosen.number) and not before.has(self.chosen.number):
            self.follow()
        return _state(self.session) != _state(before)

    def _mark(self) -> tuple[int, str]:
        """Changes whenever the session may have: its readings, the newest event of the ledger."""
        newest = self.ledger.find("event", newest=True, limit=1)
        return self.ledger.count("reading", session=self.session.id), newest[0].id if newest else ""

    def judge(self) -> None:
        """Make the running fit, and where it is wanted the next position."""
        if self.verifies:
            return
        self.place = None
        if self.session.plan == drift.CHECK:
            self.now = drift.check_progress(self.ledger, self.session, self.goal)
            return
        self.now = session_progress(self.session, self.goal, self.about_rig, earlier=self._earlier)
        if self.session.next is None and not self.now.reached and (self.adaptive or self.now.calibration is not None):
            self.place = proposal(self.session, self.goal, self.about_rig, self.now)

    def follow(self) -> None:
        """Show the first open position; the rig stays where it is."""
        left = self.open_positions
        if left:
            self.chosen = left[0]

    def choose(self, number: int) -> None:
        """Put a position on the card; the rig stays where it is."""
        self.chosen = next((p for p in self.positions if p.number == number), self.chosen)
        self._moved, self._asked = self.turner is not None, 0
        self.retakes = self.session.has(number)

    def choose_next(self) -> bool:
        """Put the first open position on the card; whether there was one."""
        left = self.open_positions
        if left:
            self.choose(left[0].number)
        return bool(left)

    def step(self, by: int) -> None:
        """The position before or after."""
        numbers = [p.number for p in self.positions]
        place = numbers.index(self.chosen.number) if self.chosen.number in numbers else 0
        self.choose(numbers[max(0, min(len(numbers) - 1, place + by))])

    def turn(self) -> None:
        """Turn a motorised rig to the position on the card; may take as long as the rig takes to answer.

        Raises
        ------
        InclinometryError
            Not allowed; the rig cannot be reached or refuses the setting.
        """
        self.visitor.require("capture")
        if self.turner is not None:
            self.turner.move(self.chosen.dial)
            self._moved = True
            self._cut()

    @property
    def rig_state(self) -> RigState | None:
        """What a motorised rig last said; None for one turned by hand."""
        return None if self.turner is None else self.turner.state

    @property
    def arrived(self) -> bool:
        """Whether the tool is taken to be at its target: a motorised rig stands there, or a capture was asked for."""
        return self._asked == self.chosen.number if self.turner is None else self.turner.state.at(self.chosen.dial)

    def _cut(self) -> None:
        """Samples up to now belong to another position."""
        if self.feed is not None:
            self.feed.moved()

    def take(self, how: str = "key", reason: str = "") -> RecordedReading:
        """Capture the position on the card; on the disk when this returns. Far from the target it needs a reason."""
        user, chosen = self.visitor.require("capture"), self.chosen
        if self.feed is None:
            raise NoInstrumentError(Finding("web-no-instrument"))
        if self.turner is not None and not self.turner.poll().at(chosen.dial):
            raise ElsewhereError(Finding("web-rig-elsewhere", {"position": chosen.number}))
        if isinstance(self.rig, ManualRig):
            # turned by hand: to capture is to say that it is set
            self.rig.move(*chosen.dial)
            self.rig.confirm()
        reading = self.feed.capture(chosen.dial, how=how)
        self._asked = chosen.number
        reading = at_target(reading, self.judged_by, self.session, self.about_rig.sd, reason)
        attempt = self.session.attempts.get(chosen.number, 0) + 1
        taken = capture(self.ledger, self.session.id, chosen.number, reading, author=user.name, attempt=attempt)
        self._moved = self.retakes = False
        self._cut()
        self.reload()
        return taken

    def leave_out(self, number: int, reason: str) -> None:
        """Leave a reading out; its position is open again."""
        user = self.visitor.require("capture")
        if not self.session.has(number):
            raise refused("session-no-reading", {"position": number})
        reject(self.ledger, self.session.taken[number], reason, author=user.name)
        self.reload()

    def finish(self) -> Record:
        """Record the calibration and close the session."""
        user = self.visitor.require("capture")
        return drift.finish(self.ledger, self.session.id, author=user.name, goal=self.goal)

    def abandon(self, reason: str) -> None:
        """Close the session without a result."""
        user = self.visitor.require("capture")
        close_session(self.ledger, self.session.id, "abandoned", author=user.name, reason=reason)

    def ready_by_itself(self, seen: Stability) -> bool:
        """Whether an automatic capture is due: the tool was turned since the last one, and is still at the target."""
        moved_words = ("moving", "knocked")
        if seen.word in moved_words:
            self._moved, self._asked = True, 0
        if not self.automatic or self.session.has(self.chosen.number) or self.session.closed:
            return False
        if not self._moved or not seen.still:
            return False
        off = self.off_now(seen)
        if off is not None and off.far:
            return False
        if self.turner is not None and not self.turner.state.at(self.chosen.dial):
            return False
        if self.target_temperature(self.chosen.number) is None:
            return True
        heat = self.heat()
        return heat is not None and heat.near and heat.even


def _state(session: Session) -> tuple[object, ...]:
    """What a page shows of a session."""
    return session.closed, tuple((t.record, bool(t.rejected)) for t in session.taken.values())


class NoInstrumentError(InputError):
    """There is nothing to capture from."""


class ElsewhereError(InclinometryError):
    """The rig does not stand at the position that is to be captured."""
