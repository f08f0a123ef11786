"""A laboratory to look around in: a tool half-way through its calibration on a simulated stand."""

from __future__ import annotations

import numpy as np

from inclinometry.calibration import plans
from inclinometry.laboratory import registry
from inclinometry.laboratory.instruments.simulated_instrument import SimulatedInstrument
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.results import finish_calibration
from inclinometry.laboratory.session import Capture, Session, capture, load_session, open_session

SERIAL = "DEMO-1"
AUTHOR = "demonstration"


def half_way(ledger: Ledger, instrument: SimulatedInstrument) -> Session:
    """Register the simulated tool and stand, calibrate once, and leave a second calibration half done.

    A ledger that has been through this already is left as it is; its newest session is returned.
    """
    if registry.find_tool(ledger, SERIAL) is None:
        triads = {kind: {"channels": triad.count, "unit": triad.unit} for kind, triad in instrument.tool.triads.items()}
        tool = registry.RegisteredTool(SERIAL, "simulated steering tool", triads, customer="none", interval_months=12)
        registry.put_tool(ledger, tool, author=AUTHOR)
        azimuth, inclination, toolface = (float(x) for x in np.broadcast_to(instrument.rig.setting_sd, 3))
        rig = registry.RegisteredRig(
            "simulated stand", (azimuth, inclination, toolface), description="three axes, turned by the program"
        )
        registry.put_rig(ledger, rig, author=AUTHOR)
        # ZZ: a code that no country has
        laboratory = {"name": "Demonstration laboratory", "address": "nowhere", "country": "ZZ"}
        registry.put_site(ledger, registry.RegisteredSite("demonstration", laboratory=laboratory), author=AUTHOR)
        first = _captured(ledger, instrument, plans.twelve(), 12)
        finish_calibration(ledger, first.id, author=AUTHOR)
        return _captured(ledger, instrument, plans.orthogonal(), 12)
    return load_session(ledger, ledger.find("session", serial=SERIAL, newest=True, limit=1)[0].id)


def _captured(ledger: Ledger, instrument: SimulatedInstrument, plan: plans.Plan, number: int) -> Session:
    """A session with its first positions taken, as fast as the simulation goes."""
    session = open_session(
        ledger, SERIAL, plan, rig="simulated stand", author=AUTHOR, settings={"site": "demonstration"}
    )
    for position in session.positions[:number]:
        # each its own noise: samples are numbered on
        taken = reading(instrument, position.dial, first=50 * position.number)
        capture(ledger, session.id, position.number, taken, author=AUTHOR)
    return load_session(ledger, session.id)


def reading(instrument: SimulatedInstrument, dial: tuple[float, float, float], first: int = 0) -> Capture:
    """The mean of 50 samples at a setting, from the sample `first`, without waiting for the stand to turn."""
    stand = instrument.stand
    stand.move(dial, 0.0, at_once=True)
    samples = [stand.sample(first + number, 0.0) for number in range(50)]
    channels = {kind: np.stack([s.channels[kind] for s in samples]) for kind in samples[0].channels}
    return Capture(
        {kind: values.mean(axis=0) for kind, values in channels.items()},
        dial,
        len(samples),
        sd={kind: values.std(axis=0, ddof=1) for kind, values in channels.items()},
        units=dict(instrument.protocol.units),
        temperature=samples[0].temperature,
        how="api",
    )
