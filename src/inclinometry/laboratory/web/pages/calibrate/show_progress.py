"""Positions taken and to take, and what the fit would certify now."""

from __future__ import annotations

import json
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from html import escape
from typing import Final

import numpy as np
from nicegui import ui

from inclinometry.constants import DIALS
from inclinometry.findings import without_notes
from inclinometry.laboratory.attitude import OffTarget
from inclinometry.laboratory.instruments.protocol import InstrumentEvent
from inclinometry.laboratory.live import WINDOW, LiveFeed, Stability
from inclinometry.laboratory.session import Position, setting_of
from inclinometry.laboratory.web.frame import Bench, Visitor
from inclinometry.laboratory.web.pages.calibrate.guided import Guided, drawing
from inclinometry.laboratory.web.pages.lists import day
from inclinometry.language import number, using_language
from inclinometry.report.words import significant

# The verdict and the live channels: ten times a second, one small message a browser, worked out once for all.

_DASH: Final = "–"


@dataclass
class _Shared:
    """What all browsers are told of a feed."""

    feed: LiveFeed
    when: float = float("-inf")
    seen: Stability | None = None
    cells: list[str] = field(default_factory=list)
    digits: dict[str, int] = field(default_factory=dict)

    def fresh(self) -> _Shared:
        """Worked out again, when it is older than most of a tenth of a second."""
        now = time.monotonic()
        fresh = 0.08
        if now - self.when > fresh:
            self.when, self.seen = now, self.feed.stability()
            seen = self.seen
            found = []
            for kind, count in channel_counts(self.feed).items():
                columns = (seen.mean.get(kind), seen.sd.get(kind), seen.drift.get(kind))
                # decimals at which the noise shows two digits; kept while they nearly fit, so that no number hops about
                floor = seen.floor.get(kind)
                noise = floor if floor is not None else seen.sd.get(kind)
                least = float(np.min(noise)) if noise is not None and len(noise) else 0.0
                wanted = int(np.clip(1 - np.floor(np.log10(least)), 0, 6)) if least > 0.0 else 1
                if abs(self.digits.get(kind, -9) - wanted) > 1:
                    self.digits[kind] = wanted
                digits = self.digits[kind]
                for axis in range(count):
                    found += [_DASH if c is None or axis >= len(c) else f"{c[axis]:.{digits}f}" for c in columns]
            self.cells = found
        return self


_SHARED: list[_Shared] = []


def _shared(bench: Bench) -> _Shared | None:
    if bench.feed is None:
        return None
    if not _SHARED or _SHARED[0].feed is not bench.feed:
        _SHARED[:] = [_Shared(bench.feed)]
    return _SHARED[0].fresh()


def channel_counts(feed: LiveFeed) -> dict[str, int]:
    """Kind -> sensors, as the protocol has them: the table has all its rows before the first sample."""
    return {kind: len(channel.fields) for kind, channel in feed.protocol.channels.items()}


class Live:
    """The verdict and the table; `show` is called ten times a second.

    The two parts stand in different places of the page: `verdict` and `table` make them.
    """

    def __init__(self, guided: Guided) -> None:
        self._guided = guided
        say, bench = guided.visitor.say, guided.visitor.bench
        # of `Stability`, and done, far, and turn: still, and not turned to its target yet
        known = ("still", "learning", "few", "moving", "drifting", "knocked", "faulty", "stale", "disconnected")
        self._words = {word: (say(f"live.{word}"), say(f"live.do_{word}")) for word in (*known, "done", "far")}
        self._words["turn"] = (say("live.do_far"), "")
        if guided.verifies:
            self._words["far"] = (say("live.far"), say("live.do_far_verify"))
        self._shared = _shared(bench)

    def verdict(self) -> None:
        """The strip beside the capture button."""
        say = self._guided.visitor.say
        lost = escape(say("live.lost"), quote=True)
        if self._guided.feed is None:
            text = f"<p class='word bad'>{escape(say('live.none'))}</p><p class='advice'>"
            text += f"{escape(say('home.no_instrument'))}</p>"
        else:
            text = (
                f"<p class='word' id='live-word' role='status' data-testid='verdict' data-lost=\"{lost}\">{_DASH}</p>"
                "<p class='advice' id='live-advice'></p>"
            )
        ui.html(text, sanitize=False).classes("verdict-strip")

    def table(self) -> None:
        """The channels; its numbers are put in by `show`."""
        feed, say = self._guided.feed, self._guided.visitor.say
        if feed is None:
            return
        head = "".join(f"<th scope='col'>{escape(say(f'live.{name}'))}</th>" for name in ("mean", "sd", "drift"))
        rows, cell = [], 0
        for kind, count in channel_counts(feed).items():
            unit = escape(self._guided.visitor.sentence(feed.protocol.units.get(kind, "")))
            for axis in range(count):
                name = f"{say(f'live.{kind}')} {'XYZ'[axis] if axis < 3 else axis + 1}"
                cells = "".join(f"<td id='live-{cell + j}'>{_DASH}</td>" for j in range(3))
                cell += 3
                rows.append(f"<tr><th scope='row'>{escape(name)} <span class='dim'>{unit}</span></th>{cells}</tr>")
        with ui.card().classes("panel live"):
            table = f"<table class='number'><tr><th scope='col'>{escape(say('live.channel'))}</th>{head}</tr>"
            foot = "<p class='detail dim number'><span id='live-heat'></span><span id='live-detail'></span></p>"
            ui.html(f"{table}{''.join(rows)}</table>{foot}", sanitize=False).props('aria-live="off"')

    def show(self) -> Stability | None:
        """Send the numbers as they are now."""
        found = _shared(self._guided.visitor.bench)
        if found is None or found.seen is None:
            return None
        seen, guided, number = found.seen, self._guided, self._guided.visitor.number
        word, advice = self._words[seen.word]
        state = seen.word
        # when all is captured, and none chosen to be captured again, there is nothing to wait for
        ended = not (guided.open_positions or guided.retakes or guided.session.closed)
        reason = guided.visitor.sentence(seen.finding)
        if ended and state in ("few", "learning", "still"):
            state, word, advice, reason = "done", *self._words["done"], ""
        off = guided.off_now(seen)
        far = off if off is not None and off.far and not guided.session.closed else None
        arrived = guided.arrived
        if far is not None and state == "still":
            state = "far" if arrived else "turn"
            word, advice = self._words[state]
            advice = f"{far_words(guided.visitor, far)}. {advice}"
        heat = "" if seen.temperature is None else f"{number(f'{seen.temperature:.1f}')} °C"
        colour = {"still": "good", "done": "good", "learning": "warn", "few": "warn", "turn": ""}  # bad for the others
        said = [state, colour.get(state, "bad"), word, advice, heat, reason, *map(number, found.cells)]
        angles: list[str] = []
        if off is not None:
            shown = [*(f"{x:.2f}°" for x in np.degrees(off.shown)), *(f"{x:+.2f}" for x in np.degrees(off.off))]
            angles = list(map(number, shown))
        red = [one.values["dial"] for one in far.dials] if far is not None and arrived else []
        parts = [json.dumps(part, ensure_ascii=False, separators=(",", ":")) for part in (said, angles, red)]
        ui.run_javascript(f"benchLive({parts[0]});benchNow({parts[1]},{parts[2]})")
        return seen


def far_words(visitor: Visitor, off: OffTarget) -> str:
    """Which dials are off, in the visitor's language: what they would say, and the target."""
    said = visitor.sentence("; ").join(map(visitor.sentence, off.dials))
    return said[:1].upper() + said[1:]


# What happened to the instrument lately: lost lines, gaps, reconnections, in a list that keeps its height.


def folded(events: tuple[InstrumentEvent, ...], most: int = 5) -> list[tuple[InstrumentEvent, int]]:
    """The newest events, newest first, with how often each kind came in a row."""
    found: list[tuple[InstrumentEvent, int]] = []
    for event in reversed(events):
        if found and found[-1][0].kind == event.kind:
            found[-1] = (found[-1][0], found[-1][1] + 1)
        elif len(found) == most:
            break
        else:
            found.append((event, 1))
    return found


class Strip:
    """The last minute of every channel; `show` is called once a second.

    Each line is the deviation from the mean of the last seconds, between plus and minus ten times the noise at rest: a
    tool that moves leaves the strip, and one that settles is seen to do so.
    """

    SECONDS: Final = 60.0
    WIDTH, HEIGHT, POINTS = 600, 60, 240

    def __init__(self, guided: Guided) -> None:
        self._guided = guided
        if guided.feed is None:
            return
        with ui.card().classes("panel strips"):
            ui.label(guided.visitor.say("bench.strip")).classes("subtitle")
            ui.html("<div id='strip'></div>", sanitize=False).props('data-testid="strip" aria-live="off"')

    def show(self) -> None:
        """Draw the strips again."""
        feed, found = self._guided.feed, _shared(self._guided.visitor.bench)
        if feed is None or found is None or found.seen is None:
            return
        window = feed.window(self.SECONDS)
        if len(window) < 2:
            return
        say, parts = self._guided.visitor.say, []
        every = max(1, len(window) // self.POINTS)
        x = self.WIDTH * (1.0 - (window.time[-1] - window.time[::every]) / self.SECONDS)
        for kind, values in window.channels.items():
            rest = values[window.time > window.time[-1] - WINDOW].mean(axis=0)
            apart = values[::every] - rest
            noise = found.seen.floor.get(kind)
            half = 10.0 * float(np.max(noise)) if noise is not None else float(np.abs(apart).max())
            half = half or 1.0
            y = self.HEIGHT / 2.0 * (1.0 - np.clip(apart / half, -1.0, 1.0))
            lines = ""
            for axis, column in enumerate(y.T):
                points = " ".join(f"{a:.0f},{b:.1f}" for a, b in zip(x, column, strict=True))
                lines += f"<polyline class='channel-{axis % 3}' points='{points}'/>"
            unit = self._guided.visitor.sentence(feed.protocol.units.get(kind, ""))
            name = f"{say(f'live.{kind}')} ±{self._guided.visitor.number(significant(half))} {unit}"
            parts.append(
                f"<div class='strip'><span class='dim small'>{escape(name)}</span>"
                f"<svg viewBox='0 0 {self.WIDTH} {self.HEIGHT}' preserveAspectRatio='none' role='img' "
                f"aria-label='{escape(say('bench.strip'), quote=True)}'><line class='zero' x1='0' x2='{self.WIDTH}' "
                f"y1='{self.HEIGHT / 2:g}' y2='{self.HEIGHT / 2:g}'/>{lines}</svg></div>"
            )
        # what the channels' colours mean, and the scale of time
        key = "".join(f"<span class='channel-{i}'>{axis}</span>" for i, axis in enumerate("XYZ"))
        start, end = (escape(say("bench.seconds", number=number)) for number in (f"−{self.SECONDS:g}", "0"))
        parts.append(
            f"<p class='key dim small'><span>{start}</span><span class='axes'>{key}</span><span>{end}</span></p>"
        )
        ui.run_javascript(f"benchStrip({json.dumps(''.join(parts), ensure_ascii=False)})")


class Events:
    """The list; `show` is called once a second and sends nothing when nothing happened."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        # closed: it is looked at when something is wrong, and what is wrong is said by the verdict
        with ui.expansion(guided.visitor.say("bench.events")).classes("panel events"):
            self._html = ui.html("", sanitize=False).props('data-testid="events" aria-live="off"')
        self.show()

    def show(self) -> None:
        """The newest events as they are now."""
        feed, say = self._guided.feed, self._guided.visitor.say
        lines = []
        for event, times in folded(() if feed is None else feed.events):
            clock = datetime.fromtimestamp(event.time, UTC).strftime("%H:%M:%S")
            often = f" ×{times}" if times > 1 else ""
            sentence = escape(self._guided.visitor.sentence(event.finding))
            lines.append(f"<li data-kind='{escape(event.kind)}'>{clock} {sentence}{often}</li>")
        quiet = f"<p class='dim'>{escape(say('bench.quiet'))}</p>"
        text = f"<ul class='number'>{''.join(lines)}</ul>" if lines else quiet
        if text != self._shown:
            self._shown = text
            self._html.set_content(text)


# The large card: where to turn the tool to, as numbers to be read from two metres, and as a picture.


def big(angle: float) -> str:
    """An angle for the card, in degrees: the whole number large, what follows it smaller."""
    text = number(f"{round(float(np.degrees(angle)), 2) + 0.0:.2f}").replace("-", "−")
    return f"{text[:-3]}<span class='rest'>{text[-3:]}°</span>"


class Target:
    """Numbers of the chosen position; call within its card."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        say = guided.visitor.say
        with ui.element("div").classes("headline"):
            self._name = ui.label().classes("subtitle number").props('data-testid="position-name"')
            self._state = ui.label().props('data-testid="position-state"')
            self._leave = ui.button(say("bench.leave_out")).props('flat dense no-caps data-testid="reject"')
        self._dials = ui.html("", sanitize=False).classes("dials").props('data-testid="target"')
        self._by = ui.label().classes("dim small judged-by").props('data-testid="judged-by"')
        self._heat = ui.label().classes("heat number").props('data-testid="heat"')
        self._heat.set_visibility(guided.target_temperature(1) is not None)

    @property
    def leave(self) -> ui.button:
        """Leaves the reading of the chosen position out."""
        return self._leave

    def show(self) -> None:
        """The chosen position as it is now."""
        guided, say = self._guided, self._guided.visitor.say
        chosen, taken = guided.chosen, guided.session.taken.get(guided.chosen.number)
        total = len(guided.session.positions)
        name = say("bench.added", number=chosen.number) if chosen.number > total or guided.adaptive else ""
        self._name.set_text(name or say("bench.position", number=chosen.number, all=total))
        text, colour = say("bench.to_capture"), "dim"
        if taken is not None and taken.rejected:
            text, colour = say("bench.was_rejected", attempt=taken.attempt, reason=taken.rejected[:80]), "warn"
        elif taken is not None:
            text, colour = say("bench.was_captured", attempt=taken.attempt, time=taken.created[11:16]), "good"
        self._state.set_text(text)
        self._state.classes(replace=f"state number {colour}")
        self._leave.set_visibility(guided.session.has(chosen.number) and not guided.session.closed)
        now = escape(say("bench.now"))
        with using_language(guided.visitor.language):
            angles = [big(angle) for angle in chosen.dial]
        cells = [
            f"<div class='dial'><span class='dim'>{escape(say(f'bench.{name}'))}</span>"
            f"<span class='digits number' data-testid='target-{name}'>{angle}</span>"
            f"<span class='now number'><span class='dim small'>{now}</span> "
            f"<span id='now-{name}' data-testid='now-{name}'></span> "
            f"<span class='off' id='off-{name}'></span></span></div>"
            for name, angle in zip(DIALS, angles, strict=True)
        ]
        if "".join(cells) != self._shown:
            self._shown = "".join(cells)
            self._dials.set_content(self._shown)
        by = guided.judged_by
        by_words = ""
        if by is not None:
            by_words = say("bench.by_earlier", when=day(by.made)) if by.made else say("bench.by_running")
        self._by.set_text(by_words if guided.feed is not None else "")
        self.show_heat()

    def show_heat(self) -> None:
        """The target temperature beside the measured one; looked at every second."""
        guided, say = self._guided, self._guided.visitor.say
        target = guided.target_temperature(guided.chosen.number)
        if target is None:
            return
        heat, text, colour = guided.heat(), say("bench.heat_target", target=f"{target:g}"), "warn"
        if heat is None:
            text += " · " + say("bench.heat_unknown")
        else:
            rate = "–" if np.isnan(heat.rate) else f"{round(heat.rate, 1) + 0.0:+.1f}"
            word = "even" if heat.even and heat.near else "uneven" if heat.near else "far"
            measured = say("bench.heat_measured", measured=f"{heat.measured:.1f}", rate=rate)
            text, colour = f"{text} · {measured} · {say(f'bench.heat_{word}')}", "good" if word == "even" else "warn"
        self._heat.set_text(text)
        self._heat.classes(replace=f"heat number {colour}")


class Picture:
    """The tool in the stand at the chosen position."""

    def __init__(self, guided: Guided) -> None:
        self._guided, self._shown = guided, ""
        say = guided.visitor.say
        with ui.card().classes("panel picture"):
            self._html = ui.html("", sanitize=False).props('data-testid="picture"')
            ui.label(say("bench.picture_key")).classes("dim small")

    def show(self) -> None:
        """Drawn again when the position has changed."""
        say, session = self._guided.visitor.say, self._guided.session
        dial = setting_of(session.dials, self._guided.chosen.dial)
        words = (escape(say("bench.north")), escape(say("bench.down")))
        text = drawing(dial, escape(say("bench.picture"), quote=True), words)
        if text != self._shown:
            self._shown = text
            self._html.set_content(text)


class PositionList:
    """The list of positions; a click puts one on the card. A button is changed only when its state is."""

    def __init__(self, guided: Guided, choose: Callable[[int], Awaitable[None]]) -> None:
        self._guided, self._choose = guided, choose
        self._buttons: dict[int, ui.html] = {}
        self._states: dict[int, tuple[str, str]] = {}
        self._here = 0
        with ui.card().classes("panel places"):
            self._title = ui.label().classes("subtitle number").props('data-testid="progress"')
            self._box = ui.element("div").classes("positions").props('role="group"')

    def show(self) -> None:
        """All positions as they are now."""
        guided, say = self._guided, self._guided.visitor.say
        done, total = len(guided.session.valid), len(guided.session.positions)
        planned = say("home.progress", done=done, all=total)
        self._title.set_text(say("bench.so_far", done=done) if guided.adaptive else planned)
        positions = {p.number: p for p in guided.positions}
        for gone in [n for n in self._buttons if n not in positions]:
            self._buttons.pop(gone).delete()
            self._states.pop(gone)
        for position in positions.values():
            self._one(position)
        # positions beyond which the list is scrolled to the chosen one
        if len(positions) > 60 and self._here != guided.chosen.number:
            self._here = guided.chosen.number
            ui.run_javascript("benchHere()")

    def _one(self, position: Position) -> None:
        guided, say, number = self._guided, self._guided.visitor.say, position.number
        outliers = {} if guided.now is None else guided.now.outliers
        state = "outlier" if number in outliers else "done" if guided.session.has(number) else "open"
        if number == guided.proposed:
            state = "proposed"
        here = " here" if number == guided.chosen.number else ""
        angles = guided.visitor.number(" / ".join(f"{np.degrees(x):.1f}°" for x in position.dial))
        heat = guided.target_temperature(number)
        angles += "" if heat is None else f", {heat:g} °C"
        shown = (f"place {state}{here}", angles)
        if self._states.get(number) == shown:
            return
        self._states[number] = shown
        if number not in self._buttons:
            with self._box:
                made = ui.html(str(number), tag="button", sanitize=False)
            made.on("click", lambda n=number: self._choose(n), [])
            self._buttons[number] = made
        button = self._buttons[number].classes(replace=shown[0])
        current = "true" if here else "false"
        label = f"{say(f'bench.state_{state}')} {number}: {angles}"
        button.props(f'type=button data-testid="position-{number}" aria-current="{current}"')
        button.props(f'aria-label="{label}" title="{label}" data-state="{state}"')


class Certifies:
    """What would be certified now, outliers, the next best position, warnings; or how a verification stands."""

    def __init__(self, guided: Guided, choose: Callable[[int], Awaitable[None]], finish: Callable[[], object]) -> None:
        self._guided, self._choose = guided, choose
        say = guided.visitor.say
        with ui.card().classes("panel certifies"):
            title = "bench.verifying" if guided.verifies else "bench.certifies"
            ui.label(say(title)).classes("subtitle")
            # above what grows and shrinks: in the window of a laptop it is in view, and never moves
            text = say("bench.judge") if guided.verifies else say("bench.finish")
            self._end = ui.button(text, on_click=finish).props('no-caps data-testid="finish"').classes("finish")
            self._box = ui.element("div").classes("found")

    def show(self) -> None:
        """The running fit as it is now."""
        guided, say = self._guided, self._guided.visitor.say
        self._box.clear()
        with self._box:
            self._goal()
            if guided.now is not None:
                for number, sentence in guided.now.outliers.items():
                    with ui.element("div").classes("outlier-row").props('role="alert"'):
                        said = ui.label(guided.visitor.sentence(sentence)).classes("bad")
                        said.props(f'data-testid="outlier-{number}"')
                        retake = ui.button(
                            say("bench.retake", number=number), on_click=lambda n=number: self._choose(n)
                        )
                        retake.props(f'outline dense no-caps data-testid="retake-{number}"')
                self._uncertainty()
                self._next_best()
        fitted = guided.now is not None and bool(guided.now.calibration)
        ready = bool(guided.session.valid) if guided.verifies else fitted
        self._end.set_enabled(ready and not guided.session.closed)
        self._end.set_visibility(not guided.session.closed)
        ended = not guided.open_positions
        self._end.props("unelevated", remove="outline") if ended else self._end.props("outline", remove="unelevated")

    def _goal(self) -> None:
        """The one large sentence: closed, reached, or everything captured."""
        guided, say = self._guided, self._guided.visitor.say
        now = guided.now
        if guided.session.closed:
            text, colour = say(f"bench.closed_{guided.session.closed}"), "dim"
        elif now is not None and now.reached:
            text, colour = say("bench.reached"), "good"
        elif not guided.open_positions and not (now is not None and now.outliers):
            fitted = guided.verifies or (now is not None and now.calibration is not None)
            text, colour = say("bench.complete"), "good" if fitted else "warn"
        else:
            return
        ui.label(text).classes(f"word {colour}").props('data-testid="goal" role="status"')
        record = guided.ledger.latest("calibration", session=guided.session.id) if guided.session.closed else None
        if record is not None:
            ui.link(say("results.title"), f"/results/{record.id}")

    def _uncertainty(self) -> None:
        guided, say = self._guided, self._guided.visitor.say
        now = guided.now
        if now is None or now.calibration is None:
            waiting = None if now is None else now.waiting
            text = say("bench.no_fit") if waiting is None else guided.visitor.sentence(waiting)
            ui.label(text).classes("dim waiting")
            return
        low, high = np.degrees(now.covered)
        with ui.element("div").classes("pair"):
            goal, alone, noise = guided.goal, now.from_calibration, now.noise
            self._line("azimuth", now.u_azimuth, alone[1], noise[1], goal.u_azimuth)
            self._line("inclination", now.u_inclination, alone[0], noise[0], goal.u_inclination)
        ui.label(say("bench.range", low=f"{low:.0f}", high=f"{high:.0f}", k=f"{now.k:g}")).classes("dim small number")
        said = list(now.outliers.values())
        others = [one for one in without_notes(now.calibration.findings) if one not in said]
        for one in others[:3]:
            ui.label(guided.visitor.sentence(one)).classes("warn small")

    def _line(self, angle: str, value: float, alone: float, noise: float, wanted: float | None) -> None:
        """U of one reading as the certificate will print it; below, from the calibration alone, and what is wanted."""
        say, name, text = self._guided.visitor.say, f"U_{angle}", self._guided.visitor.number(_degrees(value))
        colour = "" if wanted is None else "good" if value <= wanted else "warn"
        with ui.element("div").classes("uncertainty"):
            ui.label(say(f"bench.{name}")).classes("dim")
            ui.label(text).classes(f"value number {colour}").props(f'data-testid="{name.lower()}"')
            if np.isfinite(alone):
                ui.label(say("bench.alone", value=_degrees(alone))).classes("dim small number")
            if wanted is not None:
                ui.label(f"{say('bench.wanted')} {self._guided.visitor.number(_degrees(wanted))}").classes(
                    "dim small number"
                )
            if wanted is not None and noise > wanted:
                ui.label(say("bench.beyond", value=_degrees(noise))).classes("warn small").props('role="alert"')

    def _next_best(self) -> None:
        guided, say, number = self._guided, self._guided.visitor.say, self._guided.proposed
        # when all is captured and no uncertainty was agreed the run is at its end
        if number is None or guided.session.closed or not guided.open_positions:
            return
        gain = guided.gain()
        name = say(f"bench.U_{guided.goal.criterion}") if gain is not None else ""
        text = say("bench.proposed", number=number)
        if gain is not None:
            text += " · " + say("bench.gain", name=name, now=_degrees(gain[0]), then=_degrees(gain[1]))
        with ui.element("div").classes("outlier-row"):
            ui.label(text).classes("number").props('data-testid="proposed"')
            if number != guided.chosen.number:
                ui.button(say("bench.take_it"), on_click=lambda: self._choose(number)).props("outline dense no-caps")


def _degrees(angle: float) -> str:
    """An angle to the digits of a certificate."""
    return f"{significant(float(np.degrees(angle)))}°" if np.isfinite(angle) else "–"
