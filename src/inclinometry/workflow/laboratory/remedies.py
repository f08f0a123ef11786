"""What a sentence of the calibration asks for in options of the command line, in words of what the bench has."""

from __future__ import annotations

import re
from typing import Final

_DIALS: Final = {
    "--inclination-from vertical": "the inclination from the vertical",
    "--inclination-from other-end": "the inclination from the other end",
    "--inclination-from horizontal": "the inclination from the horizontal",
    "--inclination-from horizontal-up": "the inclination from the horizontal, positive above",
    "--azimuth-counts clockwise": "the azimuth clockwise",
    "--azimuth-counts counterclockwise": "the azimuth counterclockwise",
    "--toolface-counts clockwise": "the toolface clockwise",
    "--toolface-counts counterclockwise": "the toolface counterclockwise",
}
_ONE: Final = r"--(?:inclination-from|azimuth-counts|toolface-counts) [a-z-]+"
_ELSEWHERE: Final = r"--(?:(?:level|north|dip|latitude|rig)(?:-sd)?-deg|site|nameplate|stand (?:fit|level|same))"
"""Options of calibrate and verify that the bench does not have."""
_STATED: Final = (
    # the longest first: what follows is part of it
    (
        "State it, or put the column right.",
        "State it on the rig (Start a calibration, Dials of a rig): the readings stay, and are judged anew.",
    ),
    ("--left-handed states that the channels are so", "a session begun with left-handed channels states that they are"),
    (
        "(--dip-deg, dip_deg in --site, the column reference_dip_deg, or the form of the bench)",
        "(the dip of the site, or the form that begins a calibration)",
    ),
    ("(--dip-deg)", "(the dip of the site)"),
    ("(latitude_deg in --site)", "(the latitude of the site)"),
    ("state the dials, or verify", "state them on the rig (Start a calibration, Dials of a rig), or verify"),
)


def at_the_bench(sentence: str) -> str:
    """A sentence with each option of the command line replaced by what states it in the bench.

    An option that the bench does not have is said to be of the command line.

    Examples
    --------
    >>> at_the_bench("with --azimuth-counts counterclockwise --toolface-counts counterclockwise the readings fit")
    'with dials that count the azimuth counterclockwise and the toolface counterclockwise the readings fit'
    >>> at_the_bench("(state it with --north-deg)")
    '(state it with calibrate --north-deg at the command line)'
    """
    if "--" not in sentence:
        return sentence
    for said, instead in _STATED:
        sentence = sentence.replace(said, instead)

    def dials(found: re.Match[str]) -> str:
        options = re.findall(_ONE, found[0])
        return f"dials that count {' and '.join(_DIALS.get(option, option) for option in options)}"

    sentence = re.sub(rf"{_ONE}(?: {_ONE})*", dials, sentence)

    def elsewhere(found: re.Match[str]) -> str:
        command = "verify" if found[0].startswith("--stand") else "calibrate"
        return f"{command} {found[0]} at the command line"

    return re.sub(_ELSEWHERE, elsewhere, sentence)
