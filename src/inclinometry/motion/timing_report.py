"""What was found in a run's time stamps, and the sentences that say so."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, NamedTuple

LISTED: Final = 20
"""Gaps and intervals that are kept one by one."""


class Gap(NamedTuple):
    """A place where a stretch was cut: s of the last stamp before and the first after, and why."""

    before: float
    after: float
    reason: str


@dataclass
class TimingReport:
    """What was found in the stamps so far.

    Attributes
    ----------
    rows, repeats, shared, filled : int
        Rows read; rows dropped because they repeat the row before; because the place nearest to their stamp was taken;
        places of the grid without a reading.
    stretches : int
    intervals : list of float
        s, of the stretches, without repetition.
    jitter, most_jitter : float
        s, largest root mean square and largest single departure of stamps from the grid.
    gaps : list of Gap
        The first `LISTED`; `cuts` counts all.
    missing : dict
        Channel -> readings that were not numbers.
    absent : tuple of str
        Triads without any value among the first rows, left out.
    """

    rows: int = 0
    repeats: int = 0
    shared: int = 0
    filled: int = 0
    stretches: int = 0
    cuts: int = 0
    intervals: list[float] = field(default_factory=list)
    jitter: float = 0.0
    most_jitter: float = 0.0
    gaps: list[Gap] = field(default_factory=list)
    missing: dict[str, int] = field(default_factory=dict)
    absent: tuple[str, ...] = ()

    def add_interval(self, interval: float) -> None:
        """Note the interval of a stretch, once."""
        if interval not in self.intervals and len(self.intervals) <= LISTED:
            self.intervals.append(interval)

    def notes(self) -> tuple[str, ...]:
        """Sentences for the user; none where nothing had to be mended."""
        said = []
        if self.repeats:
            said.append(f"{self.repeats} of {self.rows} rows repeat the row before them (stamp and readings): dropped")
        if self.shared:
            said.append(f"the stamps of {self.shared} rows are nearest to a place that is taken: dropped")
        if self.filled:
            said.append(f"{self.filled} samples are missing in small gaps: their places are kept and not used")
        for gap in self.gaps:
            said.append(f"the run was cut between {gap.before:.9g} s and {gap.after:.9g} s: {gap.reason}")
        if self.cuts > len(self.gaps):
            said.append(f"and at {self.cuts - len(self.gaps)} more places likewise")
        if len(self.intervals) > 1:
            said.append(
                "the sampling interval changes: " + ", ".join(f"{one:.6g} s" for one in self.intervals[:LISTED])
            )
        if self.intervals and self.jitter > 0.1 * min(self.intervals):
            said.append(f"the stamps jitter by {self.jitter:.3g} s (root mean square, the worst stretch)")
        for name, count in self.missing.items():
            said.append(f"{name} has no value in {count} of {self.rows} rows: these samples are not used")
        for triad in self.absent:
            said.append(f"{triad} has no value in the first rows: the triad is left out")
        return tuple(said)
