"""Records of certificates for tests, and the official schema of the DCC, offline."""

from __future__ import annotations

import datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from inclinometry.calibration import plans
from inclinometry.calibration.conformity import verify
from inclinometry.calibration.decision import Limits
from inclinometry.calibration.joint import calibrate_joint
from inclinometry.calibration.readings import BenchReadings
from inclinometry.calibration.result import Calibration
from inclinometry.files.verification_json import judged_positions, stated_limits
from inclinometry.laboratory.certificate.laboratory import Laboratory, Order, Standard
from inclinometry.laboratory.certificate.record import certificate_record
from inclinometry.simulate.bench import Rig, simulate_bench
from inclinometry.simulate.tool import realistic_tool

SD = float(np.radians(0.05))
DAY = datetime.date
NASTY = "A #strong[x] & <b>\"o'k\"</b> \\ $x^2$ =cmd|' /C calc'!A0 {{1}} @a *b* _c_ `d` // e"
LABORATORY = Laboratory(
    "Stand & Son", "1 Street\n2 Town", "NO", "Hall 3", "NA 12", "a@b.example", "+47 1", "Anna", "head", "level No. 7",
    "QP-12",
)  # fmt: skip
STANDARDS = (Standard("Autocollimator 7", "PTB 2025-123", DAY(2027, 3, 1)), Standard("T2", "D-17", DAY(2026, 12, 31)))
ORDER = Order(
    customer="Driller",
    item="steering tool",
    serial="IN-7",
    condition="good",
    plan="orthogonal",
    rig="stand 1",
    received=DAY(2026, 5, 1),
    performed_from=DAY(2026, 5, 4),
    performed_to=DAY(2026, 5, 5),
    issued=DAY(2026, 5, 6),
    temperature_degC=(21.5, 23.0),
    humidity_percent=(30.0, 45.0),
)


@cache
def calibration(seed: int = 1, name: str = "IN-7") -> Calibration:
    """A joint calibration of one simulated tool."""
    return calibrate_joint(readings(plans.orthogonal(), seed), rig_sd=SD, name=name)


def readings(plan: plans.Plan, seed: int) -> BenchReadings:
    """Bench readings of the simulated tool."""
    stand = Rig(dip=float(np.radians(70.0)), setting_sd=(SD, SD, SD))
    run = simulate_bench(realistic_tool(7), stand, plan.azimuth, plan.inclination, plan.toolface, seed=seed)
    dials = (run.azimuth, run.inclination, run.toolface)
    return BenchReadings(run.signals, *dials, units=run.units, reference=run.reference, digest=f"sha256:{seed:064x}")


@cache
def verification(limit_deg: float | None = 1.0, guard: str = "none") -> dict[str, Any]:
    """A verification of that calibration at the twelve positions, as it is recorded."""
    limits = None
    if limit_deg is not None:
        limit = float(np.radians(limit_deg))
        limits = Limits("shop", "our own limits", limit, 3 * limit, 3 * limit, float(np.radians(5.0)), guard)
    found = verify(readings(plans.twelve(), 9), calibration(), limits, agreed=True)
    return {"verdict": found.verdict, "limits": stated_limits(limits), "report": judged_positions(found)}


def record(made: Calibration | None = None, **changes: Any) -> dict[str, Any]:
    """A whole record; calibration, `laboratory`, `order` and the keywords of `certificate_record` may be changed."""
    laboratory = changes.pop("laboratory", LABORATORY)
    order = changes.pop("order", ORDER)
    given = {"number": "2026-0001", "program": "inclinometry 0", "verification": verification(), "standards": STANDARDS}
    given |= {"accept_warnings": "the customer knows"} | changes
    return certificate_record(made or calibration(), laboratory, order, **given)


@cache
def dcc_schema() -> etree.XMLSchema:
    """DCC 3.2.1 with D-SI 2.1.0; what they import is found on the disk or not at all."""
    import xmlschema

    folder = Path(__file__).parents[2] / "reference" / "dcc"
    local = {
        "https://ptb.de/si/v2.1.0/SI_Format.xsd": folder / "SI_Format-2.1.0.xsd",
        "https://www.ptb.de/dcc/d-sig/xmldsig-core-schema.xsd": Path(xmlschema.__file__).parent
        / "schemas/DSIG/xmldsig-core-schema.xsd",
    }

    class Offline(etree.Resolver):
        def resolve(self, url: str, _: str, context: Any) -> Any:
            if url in local:
                return self.resolve_filename(str(local[url]), context)
            if url.startswith("http"):
                # the document type the signature schema names; it declares nothing that is used
                return self.resolve_string("", context)
            return None

    parser = etree.XMLParser(no_network=True)
    parser.resolvers.add(Offline())
    return etree.XMLSchema(etree.parse(folder / "dcc-3.2.1.xsd", parser))
