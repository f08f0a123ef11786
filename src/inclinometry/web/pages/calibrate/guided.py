"""What one browser's bench page knows and does; how it looks is in the modules beside it."""

from __future__ import annotations

from inclinometry.calibration.design import NextPosition
from inclinometry.core.errors import InputError
from inclinometry.store.ledger import Record
from inclinometry.web.frame import Visitor
from inclinometry.workflow.laboratory.goals import goal_of
from inclinometry.workflow.laboratory.live import Stability
from inclinometry.workflow.laboratory.registry import RegisteredRig, find_rig, find_site
from inclinometry.workflow.laboratory.results import finish_calibration
from inclinometry.workflow.laboratory.session import (
    Capture,
    Position,
    Session,
    Taken,
    capture,
    close_session,
    load_session,
    reject,
)
from inclinometry.workflow.laboratory.standing import Standing, proposal, standing

MOVED_WORDS = ("moving", "knocked")


class Guided:
    """A session as one browser works on it.

    session : as the ledger has it, newest first call of `reload`.
    chosen : the position on the large card.
    now, place : the running fit and the position it proposes; None before the first.
    automatic : capture by itself when the tool has moved and stands still.
    """

    def __init__(self, visitor: Visitor, session: str) -> None:
        self.visitor = visitor
        self.ledger, self.feed, self.rig = visitor.bench.ledger, visitor.bench.feed, visitor.bench.rig
        self.session: Session = load_session(self.ledger, session)
        self.goal = goal_of(self.ledger, self.session)
        found = find_rig(self.ledger, self.session.rig)
        # a session cannot be opened without its rig, and records are never removed
        self.about_rig: RegisteredRig = found if found is not None else RegisteredRig(self.session.rig, (0.0, 0.0, 0.0))
        self.site = find_site(self.ledger, str(self.session.settings.get("site", "")))
        self.now: Standing | None = None
        self.place: NextPosition | None = None
        self.automatic = False
        self._moved = True
        self.chosen: Position = self._first()

    @property
    def adaptive(self) -> bool:
        """Whether the plan is made while it is run."""
        return bool(self.session.settings.get("settings", {}).get("adaptive"))

    @property
    def positions(self) -> tuple[Position, ...]:
        """The plan, then positions that were added, then the one proposed."""
        planned = {p.number: p for p in self.session.positions}
        added = {n: Position(n, t.capture.dial) for n, t in self.session.taken.items() if n not in planned}
        every = {**planned, **added}
        if self.place is not None and self.session.next is None and not self.session.closed:
            dial = (self.place.azimuth, self.place.inclination, self.place.toolface)
            every[max(every) + 1] = Position(max(every) + 1, dial)
        return tuple(every[n] for n in sorted(every))

    def _first(self) -> Position:
        return self.session.next or self.positions[-1]

    def reload(self) -> None:
        """Read the session again: another browser may have captured something."""
        self.session = load_session(self.ledger, self.session.id)

    @property
    def known(self) -> int:
        """How many readings of the session the ledger has."""
        return self.ledger.count("reading", session=self.session.id)

    def judge(self) -> None:
        """Make the running fit, and where it is wanted the next position."""
        self.now = standing(self.session, self.goal, self.about_rig, self.site)
        self.place = None
        if self.session.next is None and not self.now.reached and (self.adaptive or self.now.calibration is not None):
            self.place = proposal(self.session, self.goal, self.about_rig, self.now)

    def choose(self, number: int) -> None:
        """Put a position on the card; a rig that can is turned to it."""
        self.chosen = next((p for p in self.positions if p.number == number), self.chosen)
        if self.rig is not None:
            self.rig.move(*self.chosen.dial)
        if self.feed is not None:
            self.feed.moved()
        self._moved = self.rig is not None

    def choose_next(self) -> None:
        """The first position without a reading, or the proposed one."""
        open_ones = [p for p in self.positions if not self.session.has(p.number)]
        if open_ones:
            self.choose(open_ones[0].number)

    def step(self, by: int) -> None:
        """The position before or after."""
        numbers = [p.number for p in self.positions]
        place = numbers.index(self.chosen.number) if self.chosen.number in numbers else 0
        self.choose(numbers[max(0, min(len(numbers) - 1, place + by))])

    def take(self, how: str = "key") -> Taken:
        """Capture the position on the card; it is on the disk when this returns.

        Raises
        ------
        InclinometryError
            Not allowed, no instrument, nothing fresh from it, somebody else was first.
        """
        user = self.visitor.require("capture")
        if self.feed is None:
            raise NoInstrumentError(self.visitor.say("home.no_instrument"))
        reading: Capture = self.feed.capture(self.chosen.dial, how=how)
        attempt = self.session.attempts.get(self.chosen.number, 0) + 1
        taken = capture(self.ledger, self.session.id, self.chosen.number, reading, author=user.name, attempt=attempt)
        self.reload()
        return taken

    def leave_out(self, number: int, reason: str) -> None:
        """Leave a reading out; its position is open again."""
        user = self.visitor.require("capture")
        reject(self.ledger, self.session.taken[number], reason, author=user.name)
        self.reload()

    def finish(self) -> Record:
        """Record the calibration and close the session."""
        user = self.visitor.require("capture")
        return finish_calibration(self.ledger, self.session.id, author=user.name, goal=self.goal)

    def abandon(self, reason: str) -> None:
        """Close the session without a result."""
        user = self.visitor.require("capture")
        close_session(self.ledger, self.session.id, "abandoned", author=user.name, reason=reason)

    def ready_by_itself(self, seen: Stability) -> bool:
        """Whether an automatic capture is due: the tool was turned since the last one, and stands still now."""
        if seen.word in MOVED_WORDS:
            self._moved = True
        if not self.automatic or self.session.has(self.chosen.number) or self.session.closed:
            return False
        return self._moved and seen.still and (self.rig is None or self.rig.ready())


class NoInstrumentError(InputError):
    """There is nothing to capture from."""
