"""The named scenarios, each with its sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from inclinometry.core.constants import STANDARD_GRAVITY
from inclinometry.simulate.drilling.instrument import Instrument, TriadErrors
from inclinometry.simulate.drilling.scenario import (
    Band,
    Rotation,
    Scenario,
    Shocks,
    StickSlip,
    Swing,
    Vibration,
    Whirl,
)

_G = STANDARD_GRAVITY
_RPM = math.tau / 60.0
_BIAS = math.radians(0.1)

_TOOL = Instrument(
    lever=(0.02, 0.01, 0.0),
    accel=TriadErrors(noise=0.003 * _G),
    mag=TriadErrors(noise=50.0),
    gyro=TriadErrors(bias=(_BIAS, _BIAS, _BIAS), scale=(0.001, 0.001, 0.001)),
)


def _vibration(lateral: float, axial: float) -> Vibration:
    """rms in g, with one shock a second of 20 to 50 g."""
    return Vibration(
        Band(15.0, 200.0, lateral * _G, 2), Band(5.0, 80.0, axial * _G, 2), Shocks(1.0, 20.0 * _G, 50.0 * _G)
    )


_FIVE = Scenario(
    "120 rpm swinging from 0.2 to 1.8 times that, 5 g rms lateral and 2 g rms axial vibration, a shock a second.",
    rotation=Rotation(120.0 * _RPM, Swing(0.8, 0.2), ripple=0.05),
    vibration=_vibration(5.0, 2.0),
    instrument=_TOOL,
)

SCENARIOS: Final[Mapping[str, Scenario]] = MappingProxyType(
    {
        "smooth": replace(
            _FIVE,
            summary="Steady 120 rpm with 1 g rms lateral and 0.5 g rms axial vibration, no shocks.",
            rotation=Rotation(120.0 * _RPM),
            vibration=replace(_vibration(1.0, 0.5), shocks=None),
        ),
        "vibration-5g": _FIVE,
        "vibration-20g": replace(
            _FIVE,
            summary="As vibration-5g with 20 g rms lateral and 8 g rms axial vibration.",
            vibration=_vibration(20.0, 8.0),
        ),
        "stick-slip": replace(
            _FIVE,
            summary="Stuck for a third of every 5 s, then up to 600 rpm (200 rpm mean); vibration as vibration-5g.",
            rotation=Rotation(200.0 * _RPM, StickSlip(1.0 / 3.0, 0.2), ripple=0.05),
        ),
        "sliding": replace(
            _FIVE,
            summary="Motor drilling without rotation: toolface wandering by 5 deg rms, vibration as vibration-5g.",
            rotation=Rotation(wander=math.radians(5.0), torsion=Band(3.0, 30.0, math.radians(0.2))),
        ),
        "stationary": replace(
            _FIVE,
            summary="Nothing moves but the Earth: sensor noise only.",
            rotation=Rotation(),
            vibration=Vibration(),
        ),
        "fast": replace(
            _FIVE,
            summary="Steady 600 rpm, vibration as vibration-5g.",
            rotation=Rotation(600.0 * _RPM),
        ),
        "whirl": replace(
            _FIVE,
            summary="Steady 120 rpm, backward whirl rolling along the wall at 8 times that with contact shocks.",
            rotation=Rotation(120.0 * _RPM),
            vibration=replace(
                _vibration(2.0, 1.0),
                shocks=None,
                whirl=Whirl(-8.0, 0.004, Shocks(4.0, 10.0 * _G, 40.0 * _G)),
            ),
        ),
    }
)
"""The named scenarios; `summary` is the sentence for help and documents. Their truth is synthetic."""
