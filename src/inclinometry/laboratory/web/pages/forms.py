"""The form of what is registered, made of its declaration; what is wrong is said at the field it concerns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from datetime import date
from typing import Any, Final, get_args, get_type_hints

import numpy as np
from annotated_types import Interval, MaxLen
from nicegui import ui

from inclinometry.calibration.conventions import USUAL, Dials
from inclinometry.constants import DIALS
from inclinometry.errors import InclinometryError
from inclinometry.laboratory.certificate.laboratory import LONGEST
from inclinometry.laboratory.ledger.engine import plain
from inclinometry.laboratory.ledger.users import User
from inclinometry.laboratory.registry import declared
from inclinometry.laboratory.web.frame import Visitor

LONGEST_KEY: Final = 200


class FieldError(ValueError):
    """What a person wrote into a field cannot be used; the sentence says what can."""


def number_in(visitor: Visitor, label: str, text: str, limits: tuple[float, float], *, whole: bool = False) -> float:
    """A number as people write it, with a point or a comma.

    Raises
    ------
    FieldError
        No number, not a whole one, outside its limits.
    """
    low, high = limits
    try:
        value = float(text.strip().replace(",", ".").replace("−", "-"))
    except ValueError:
        raise FieldError(visitor.say("form.number", field=label)) from None
    if not np.isfinite(value):
        raise FieldError(visitor.say("form.number", field=label))
    if whole and value != round(value):
        raise FieldError(visitor.say("form.whole", field=label))
    if not low <= value <= high:
        raise FieldError(visitor.say("form.outside", field=label, low=f"{low:g}", high=f"{high:g}"))
    return value


class NumberField:
    """A text field that holds a number, or nothing where none is needed; call within a form."""

    def __init__(
        self,
        visitor: Visitor,
        label: str,
        value: float | None,
        limits: tuple[float, float],
        *,
        needed: bool = False,
        whole: bool = False,
    ) -> None:
        self._visitor, self._label, self._limits = visitor, label, limits
        self._needed, self._whole = needed, whole
        shown = "" if value is None else f"{round(value, 9):g}" if abs(value) < 1e5 else f"{value:.10g}"
        self.input = ui.input(label, value=shown).props("inputmode=decimal maxlength=30")

    def read(self) -> float | None:
        """The number; None where it is left blank.

        Raises
        ------
        FieldError
        """
        text = str(self.input.value or "")
        if not text.strip() and not self._needed:
            return None
        return number_in(self._visitor, self._label, text, self._limits, whole=self._whole)


class DialsChoice:
    """How the three dials of a rig count; call within a form."""

    def __init__(self, visitor: Visitor, known: Dials = USUAL) -> None:
        say = visitor.say
        self.parts = []
        for name, allowed in get_type_hints(Dials).items():
            words = {word: say(f"dials.{word}") for word in get_args(allowed)}
            part = ui.select(words, value=getattr(known, name), label=say(f"start.{name}"))
            self.parts.append(part.props(f'data-testid="{name}"'))

    @property
    def dials(self) -> Dials:
        """What is chosen."""
        return Dials(*(part.value for part in self.parts))


def tell(widget: Any, sentence: str) -> None:
    """Show what is wrong at its field; nothing where the sentence is empty."""
    if isinstance(widget, ui.input | ui.select):
        widget.error = sentence or None


class RecordForm:
    """Fields of something registered; saved as a new record.

    of : its declaration. old : what is changed, None for a new one. may : "capture", "issue" or "administer".
    find : the record of a key; a new one must not have the key of another.
    save : (user, what the form says) records it; an InclinometryError is shown below the form.
    """

    def __init__(
        self,
        visitor: Visitor,
        of: type[Any],
        old: Any,
        save: Callable[[User, Any], None],
        *,
        find: Callable[[str], Any] | None = None,
        leave_out: tuple[str, ...] = (),
        may: str = "capture",
    ) -> None:
        self._visitor, self._of, self._old, self._save, self._find = visitor, of, old, save, find
        self._key = fields(of)[0].name
        # a field: where what is wrong is said, and what gives its value or raises FieldError
        self._parts: dict[str, tuple[Any, Callable[[], Any]]] = {}
        with ui.element("div").classes("record-form"):
            self._key_field()
            for one, hint, place in declared(of):
                if one.name in leave_out:
                    continue
                default = None if one.default is MISSING else one.default
                value = default if old is None else getattr(old, one.name)
                self._field(one.name, hint, place.name, place.limits, value)
        self._problem = ui.label("").classes("bad").props('role="alert" data-testid="form-problem"')
        visitor.button("tools.save", 'unelevated no-caps data-testid="save"', may, self._go)

    def _key_field(self) -> None:
        old, label = self._old, self._label(self._key)
        most = LONGEST if is_dataclass(self._of) and self._find is None else LONGEST_KEY
        widget = ui.input(label, value="" if old is None else getattr(old, self._key)).props(f"maxlength={most}")
        # what is registered keeps its key; a laboratory may change its name
        widget.set_enabled(old is None or self._find is None)

        def read() -> str:
            text = str(widget.value or "").strip()
            if not plain(text):
                raise FieldError(self._visitor.say("form.needed", field=label, most=most))
            if old is None and self._find is not None and self._find(text) is not None:
                raise FieldError(self._visitor.say("form.there", field=label))
            return text

        self._parts[self._key] = (widget, read)

    def _label(self, name: str) -> str:
        return self._visitor.say(f"field.{name}")

    def _field(self, name: str, hint: Any, outside: str, limits: tuple[float, float] | None, value: Any) -> None:
        marks = getattr(hint, "__metadata__", ())
        plain_hint = getattr(hint, "__origin__", hint) if marks else hint
        # one of the unit that people write in, as the record holds it
        unit = float(np.radians(1.0)) if outside.endswith("_deg") else 1.0
        kinds = {*get_args(plain_hint), plain_hint}
        if plain_hint is Dials:
            ui.label(self._visitor.say("form.dials")).classes("dim wide-row")
            choice = DialsChoice(self._visitor, value or USUAL)
            self._parts[name] = (None, lambda: choice.dials)
        elif plain_hint is bool:
            switch = ui.switch(self._label(name), value=bool(value))
            self._parts[name] = (None, lambda: bool(switch.value))
        elif plain_hint is str:
            self._text(name, next((m.max_length for m in marks if isinstance(m, MaxLen)), LONGEST), value or "")
        elif date in kinds:
            self._date(name, value)
        elif getattr(plain_hint, "__origin__", None) is tuple:
            self._tuple(name, len(get_args(plain_hint)), limits or (-np.inf, np.inf), value, unit)
        elif float in kinds or int in kinds:
            span = next(((m.ge, m.le) for m in marks if isinstance(m, Interval)), None)
            whole = int in kinds
            number = NumberField(
                self._visitor,
                self._label(name),
                None if value is None else value / unit,
                limits or span or (-np.inf, np.inf),  # type: ignore[arg-type]
                whole=whole,
            )

            def read() -> Any:
                found = number.read()
                return None if found is None else int(found) if whole else found * unit

            self._parts[name] = (number.input, read)

    def _text(self, name: str, most: int, value: str) -> None:
        widget = ui.input(self._label(name), value=value).props(f"maxlength={most}")

        def read() -> str:
            text = str(widget.value or "").strip()
            if len(text) > most:
                raise FieldError(self._visitor.say("form.long", field=self._label(name), most=most))
            if name == "country" and text and not (len(text) == 2 and text.isascii() and text.isupper()):
                raise FieldError(self._visitor.say("form.country", field=self._label(name)))
            return text

        self._parts[name] = (widget, read)

    def _date(self, name: str, value: date | None) -> None:
        widget = ui.input(self._label(name), value="" if value is None else value.isoformat()).props("type=date")
        widget.props("stack-label")

        def read() -> date | None:
            text = str(widget.value or "").strip()
            try:
                return date.fromisoformat(text) if text else None
            except ValueError:
                raise FieldError(self._visitor.say("form.date", field=self._label(name))) from None

        self._parts[name] = (widget, read)

    def _tuple(self, name: str, count: int, limits: tuple[float, float], value: Any, unit: float) -> None:
        """A range from and to, or one number for each dial."""
        say = self._visitor.say
        words = [say("form.from"), say("form.to")] if count == 2 else [f"{say(f'bench.{dial}')}, °" for dial in DIALS]
        known = [None] * count if value is None else [x / unit for x in value]
        numbers = []
        with ui.element("fieldset").classes("group" if count == 2 else "group three"):
            with ui.element("legend").classes("dim"):
                ui.label(self._label(name))
            for word, number in zip(words, known, strict=True):
                numbers.append(NumberField(self._visitor, word, number, limits, needed=True))

        def read_one(place: int) -> float:
            found = numbers[place].read() or 0.0
            if count == 2 and (numbers[0].read() or 0.0) > found:
                raise FieldError(say("form.order"))
            return found * unit

        for place, one in enumerate(numbers):
            self._parts[f"{name}.{place}"] = (one.input, lambda place=place: read_one(place))  # type: ignore[misc]

    def said(self) -> Mapping[str, Any] | None:
        """What the form says; None when something in it cannot be used, which is then said at its field."""
        found: dict[str, Any] = {}
        wrong = False
        for name, (widget, read) in self._parts.items():
            try:
                value, sentence = read(), ""
            except FieldError as error:
                value, sentence, wrong = None, str(error), True
            tell(widget, sentence)
            group, dot, _ = name.partition(".")
            found[group] = (*found.get(group, ()), value) if dot else value
        return None if wrong else found

    def _go(self, user: User) -> None:
        self._problem.set_text("")
        said = self.said()
        if said is None:
            return
        made = self._of(**said) if self._old is None else replace(self._old, **said)
        try:
            self._save(user, made)
        except InclinometryError as error:
            self._problem.set_text(self._visitor.problem(error))
