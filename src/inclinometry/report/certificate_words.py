"""The fixed texts of a certificate in its languages, and the fonts that can show them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from inclinometry.core.errors import InputError

CHINESE: Final = (
    "Noto Sans SC",
    "Noto Sans CJK SC",
    "Noto Serif CJK SC",
    "Source Han Sans SC",
    "Source Han Sans CN",
    "Microsoft YaHei",
    "PingFang SC",
    "Hiragino Sans GB",
    "SimSun",
    "SimHei",
    "WenQuanYi Zen Hei",
    "WenQuanYi Micro Hei",
    "Droid Sans Fallback",
    "AR PL UMing CN",
)
"""Fonts with Chinese letters that come with systems; none is small enough to come with a program."""
SERIF: Final = "Libertinus Serif"
"""Comes with typst; Latin, Greek, Cyrillic."""
REST: Final = "DejaVu Sans"
"""Comes with matplotlib; shows what the serif lacks."""
NARROW: Final = 2
"""How many fonts show everything but Chinese."""


class Words:
    """The texts of one language."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = texts

    def __call__(self, key: str, **values: object) -> str:
        """The text with its places filled in; the values are put in as they are."""
        text = self._texts[key]
        return text.format(**values) if values else text

    def method(self, name: str) -> str:
        """What a method of calibration is; its own name where there is no sentence."""
        said = self._texts.get(f"m_{name}")
        return name if said is None else f"{name}: {said}"


@cache
def words(language: str) -> Words:
    """The texts of a language.

    Examples
    --------
    >>> words("ru")("page", page=1, pages=3)
    'Страница 1 из 3'
    """
    text = files("inclinometry.report").joinpath("templates", "certificate_words.json").read_text("utf-8")
    return Words(json.loads(text)[language])


def needs_chinese(text: str) -> bool:
    """Whether a text holds letters that only the large fonts have.

    Examples
    --------
    >>> needs_chinese("Сертификат №1"), needs_chinese("校准证书")
    (False, True)
    """
    return any("\u2e80" <= c <= "\u9fff" or "\uac00" <= c <= "\ud7af" or "\uf900" <= c <= "\uffef" for c in text)


def chinese_font(folders: Sequence[str | Path] = ()) -> str | None:
    """Name of the first font of this computer, or of these folders, with Chinese letters; None where there is none."""
    import typst

    known = set(typst.Fonts(include_system_fonts=True, font_paths=[str(f) for f in folders]).families())
    return next((name for name in CHINESE if name in known), None)


def families(text: str, folders: Sequence[str | Path] = ()) -> tuple[str, ...]:
    """Fonts to set a text in, in order of preference.

    Raises
    ------
    InputError
        Chinese letters, and no font on this computer has them.
    """
    if not needs_chinese(text):
        return (SERIF, REST)
    found = chinese_font(folders)
    if found is None:
        raise InputError(
            "this certificate has Chinese letters and no font on this computer shows them; install one "
            f"({', '.join(CHINESE[:3])}, ...) or choose another language"
        )
    return (SERIF, REST, found)
