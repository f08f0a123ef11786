"""Tools, rigs and sites."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, HTTPException, Query
from pydantic import BaseModel, ConfigDict, Field

from inclinometry.calibration.conventions import Counts, Dials, InclinationFrom
from inclinometry.laboratory import registry
from inclinometry.laboratory.ledger.ledger import Record
from inclinometry.laboratory.web.api.access import REFUSALS, Key, Limit, Operator, Reader, TheLedger

router = APIRouter(tags=["registry"], responses=REFUSALS)

Text = Annotated[str, Field(max_length=2000)]
Pair = tuple[float, float]


class ToolBody(BaseModel):
    """A tool; `inclination_range_deg` is where it will work."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    name: Text
    triads: dict[str, dict[str, Any]] = Field(default_factory=dict, max_length=3)
    manufacturer: Text = ""
    customer: Text = ""
    description: Text = ""
    inclination_range_deg: Pair = (10.0, 90.0)
    interval_months: int | None = Field(default=None, ge=1, le=120)
    retired: bool = False


class RigBody(BaseModel):
    """A rig: standard deviations of azimuth, inclination and toolface settings, and how its dials count.

    What it can be set to, `azimuth_deg` and so on, is in the conventions of the program however the dials count:
    azimuth and toolface clockwise, inclination from the vertical. Positions and readings of a session are what the
    dials say.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    sd_deg: tuple[float, float, float]
    azimuth_deg: Pair = (0.0, 360.0)
    inclination_deg: Pair = (0.0, 180.0)
    toolface_deg: Pair = (0.0, 360.0)
    description: Text = ""
    traceability: Text = ""
    place: Text = ""
    inclination_from: InclinationFrom = "vertical"
    azimuth_counts: Counts = "clockwise"
    toolface_counts: Counts = "clockwise"


class SiteBody(BaseModel):
    """A site: fields and latitude (north positive, for gyros) where they are known, and the laboratory's name and
    address.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    g_mps2: float | None = None
    b_nT: float | None = None  # noqa: N815
    dip_deg: float | None = Field(default=None, ge=-90.0, le=90.0)
    latitude_deg: float | None = Field(default=None, ge=-90.0, le=90.0)
    laboratory: dict[str, Text] = Field(default_factory=dict, max_length=20)
    description: Text = ""


@router.get("/tools")
def list_tools(
    ledger: TheLedger, _: Reader, after: Annotated[str, Query(max_length=200)] = "", limit: Limit = 100
) -> list[dict[str, Any]]:
    """Tools by serial number, beyond `after`."""
    return [shown(record) for record in ledger.current("tool", after=after, limit=limit)]


@router.get("/tools/{serial:path}")
def one_tool(ledger: TheLedger, _: Reader, serial: Key) -> dict[str, Any]:
    """One tool as it is now."""
    record = ledger.latest("tool", serial=serial)
    if record is None:
        raise HTTPException(404, f"there is no tool {serial!r:.80}")
    return shown(record)


@router.put("/tools/{serial:path}")
def change_tool(ledger: TheLedger, user: Operator, serial: Key, body: ToolBody) -> dict[str, Any]:
    """Register a tool, or record what changed."""
    values = body.model_dump(exclude={"inclination_range_deg"})
    low, high = _radians(body.inclination_range_deg)
    tool = registry.RegisteredTool(serial, inclination_range=(low, high), **values)
    return shown(registry.put_tool(ledger, tool, author=user.name))


@router.get("/rigs")
def list_rigs(ledger: TheLedger, _: Reader) -> list[dict[str, Any]]:
    """Rigs by name."""
    return [shown(record) for record in ledger.current("rig")]


@router.put("/rigs/{name:path}")
def change_rig(ledger: TheLedger, user: Operator, name: Key, body: RigBody) -> dict[str, Any]:
    """Register a rig, or record what changed."""
    azimuth, inclination, toolface = _radians(body.sd_deg)
    limits = {dial: _radians(getattr(body, f"{dial}_deg")) for dial in ("azimuth", "inclination", "toolface")}
    rig = registry.RegisteredRig(
        name,
        (azimuth, inclination, toolface),
        **limits,  # type: ignore[arg-type]
        description=body.description,
        traceability=body.traceability,
        place=body.place,
        dials=Dials(body.inclination_from, body.azimuth_counts, body.toolface_counts),
    )
    return shown(registry.put_rig(ledger, rig, author=user.name))


@router.get("/sites")
def list_sites(ledger: TheLedger, _: Reader) -> list[dict[str, Any]]:
    """Sites by name."""
    return [shown(record) for record in ledger.current("site")]


@router.put("/sites/{name:path}")
def change_site(ledger: TheLedger, user: Operator, name: Key, body: SiteBody) -> dict[str, Any]:
    """Register a site, or record what changed."""
    dip, latitude = (None if x is None else float(np.radians(x)) for x in (body.dip_deg, body.latitude_deg))
    site = registry.RegisteredSite(name, body.g_mps2, body.b_nT, dip, body.laboratory, body.description, latitude)
    return shown(registry.put_site(ledger, site, author=user.name))


def shown(record: Record) -> dict[str, Any]:
    """A record as the interface gives it."""
    return {
        "id": record.id,
        "seq": record.seq,
        "created": record.created,
        "author": record.author,
        **record.keys,
        "body": dict(record.body),
        "digest": record.digest,
    }


def _radians(values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(float(x) for x in np.radians(values))
