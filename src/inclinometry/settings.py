"""Settings of a method, each stated once: type, range with its unit, what it is, default."""

from __future__ import annotations

from typing import Annotated, ClassVar, NamedTuple, get_args, get_origin, get_type_hints

from inclinometry.arrays import within


class Range(NamedTuple):
    """Lowest and highest value allowed; None is let through, for a part that is switched off."""

    low: float
    high: float
    unit: str = ""


class Settings:
    """Base of frozen dataclasses whose fields are `Annotated[type, Range(...), "what it is"]`; ranges are checked."""

    _ranges: ClassVar[dict[str, Range]] = {}

    def __init_subclass__(cls) -> None:
        hints = get_type_hints(cls, include_extras=True)
        notes = [
            (name, note) for name, hint in hints.items() if get_origin(hint) is Annotated for note in get_args(hint)
        ]
        cls._ranges = {name: note for name, note in notes if isinstance(note, Range)}

    def __post_init__(self) -> None:
        for name, allowed in self._ranges.items():
            if getattr(self, name) is not None:
                within(getattr(self, name), name, *allowed)
