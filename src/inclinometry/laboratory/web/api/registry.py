"""Tools, rigs, sites, reference standards and the laboratory itself."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import MISSING, asdict, fields, is_dataclass
from typing import Annotated, Any, TypeVar, get_type_hints

from fastapi import APIRouter, Query
from pydantic import BaseModel, Field, create_model

from inclinometry.errors import refused
from inclinometry.laboratory import registry
from inclinometry.laboratory.certificate.laboratory import Laboratory, Standard
from inclinometry.laboratory.ledger.chain import LedgerError, missing
from inclinometry.laboratory.ledger.ledger import Record
from inclinometry.laboratory.web.api.access import (
    REFUSALS,
    Administrator,
    Body,
    Key,
    Limit,
    Metrologist,
    Operator,
    Reader,
    TheLedger,
    attributes,
)
from inclinometry.laboratory.web.api.certificates import LaboratoryBody, Text

router = APIRouter(tags=["registry"], responses=REFUSALS)

B = TypeVar("B", bound=BaseModel)


def body_of(of: type[Any], *without: str) -> Callable[[type[B]], type[B]]:
    """Give a body the fields of what it registers, with their types, limits and defaults."""

    def filled(body: type[B]) -> type[B]:
        made: dict[str, Any] = {}
        for one, hint, (name, _, _) in registry.declared(of):
            if is_dataclass(hint):
                made |= {inner.name: (get_type_hints(hint)[inner.name], inner.default) for inner in fields(hint)}
            elif one.name not in without:
                default = ... if one.default is MISSING else registry.external_value(name, one.default)
                factory = one.default_factory
                made[name] = (hint, default if factory is MISSING else Field(default_factory=factory))
        return create_model(body.__name__, __base__=body, __module__=body.__module__, __doc__=body.__doc__, **made)

    return filled


@body_of(registry.RegisteredTool, "convention")
class ToolBody(Body):
    """A tool; `inclination_range_deg` is where it will work."""


@body_of(registry.RegisteredRig, "driver")
class RigBody(Body):
    """A rig: standard deviations of azimuth, inclination and toolface settings, and how its dials count.

    What it can be set to, `azimuth_deg` and so on, is in the conventions of the program however the dials count:
    azimuth and toolface clockwise, inclination from the vertical. Positions and readings of a session are what the
    dials say.
    """


@body_of(registry.RegisteredSite)
class SiteBody(Body):
    """A site: fields and latitude (north positive, for gyros) where they are known, and the laboratory's name and
    address.
    """


@body_of(Standard)
class StandardBody(Body):
    """A reference standard: number of its certificate, day on which it is due."""


class SettingsBody(LaboratoryBody):
    """What the laboratory says of itself on certificates; a logo that is not given stays, an empty one is removed."""

    email: Text = ""
    phone: Text = ""
    authoriser: Text = ""
    authoriser_role: Text = ""
    logo_base64: Annotated[str, Field(max_length=4 * registry.LARGEST_LOGO // 3 + 4)] | None = None


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
        raise LedgerError(missing("tool", serial, ledger.shown))
    return shown(record)


@router.put("/tools/{serial:path}")
def change_tool(ledger: TheLedger, user: Operator, serial: Key, body: ToolBody) -> dict[str, Any]:
    """Register a tool, or record what changed."""
    tool = registry.from_record_body(registry.RegisteredTool, serial, body.model_dump(exclude_unset=True))
    return shown(registry.put_tool(ledger, tool, author=user.name))


@router.get("/rigs")
def list_rigs(ledger: TheLedger, _: Reader) -> list[dict[str, Any]]:
    """Rigs by name."""
    return [shown(record) for record in ledger.current("rig")]


@router.put("/rigs/{name:path}")
def change_rig(ledger: TheLedger, user: Operator, name: Key, body: RigBody) -> dict[str, Any]:
    """Register a rig, or record what changed."""
    rig = registry.from_record_body(registry.RegisteredRig, name, body.model_dump(exclude_unset=True))
    return shown(registry.put_rig(ledger, rig, author=user.name))


@router.get("/sites")
def list_sites(ledger: TheLedger, _: Reader) -> list[dict[str, Any]]:
    """Sites by name."""
    return [shown(record) for record in ledger.current("site")]


@router.put("/sites/{name:path}")
def change_site(ledger: TheLedger, user: Operator, name: Key, body: SiteBody) -> dict[str, Any]:
    """Register a site, or record what changed."""
    site = registry.from_record_body(registry.RegisteredSite, name, body.model_dump(exclude_unset=True))
    return shown(registry.put_site(ledger, site, author=user.name))


@router.get("/standards")
def list_standards(ledger: TheLedger, _: Reader) -> list[dict[str, Any]]:
    """Reference standards by name."""
    return [{"name": one.name, **registry.to_record_body(one)} for one in registry.standards(ledger)]


@router.put("/standards/{name:path}")
def change_standard(ledger: TheLedger, user: Metrologist, name: Key, body: StandardBody) -> dict[str, Any]:
    """Register a reference standard, or record what changed."""
    standard = registry.from_record_body(Standard, name, body.model_dump(exclude_unset=True))
    return shown(registry.put_standard(ledger, standard, author=user.name))


@router.get("/laboratory")
def the_laboratory(ledger: TheLedger, _: Reader) -> dict[str, Any]:
    """What the laboratory says of itself on certificates; empty where nothing is recorded."""
    found, logo = registry.find_laboratory(ledger), registry.find_logo(ledger)
    about = {} if found is None else {name: value for name, value in asdict(found).items() if value}
    return {"laboratory": about, "logo": None if logo is None else {"media_type": logo[0], "bytes": len(logo[1])}}


@router.put("/laboratory")
def change_laboratory(ledger: TheLedger, user: Administrator, body: SettingsBody) -> dict[str, Any]:
    """Record what the laboratory says of itself on certificates."""
    logo = None
    if body.logo_base64 is not None:
        try:
            logo = base64.b64decode(body.logo_base64, validate=True)
        except ValueError as error:
            raise refused("file-format", {"format": "Base64", "reason": str(error)}) from None
    return shown(
        registry.put_laboratory(
            ledger, Laboratory(**body.model_dump(exclude={"logo_base64"})), author=user.name, logo=logo
        )
    )


def shown(record: Record) -> dict[str, Any]:
    """A record as the interface gives it."""
    own = attributes(record, "id", "seq", "created", "author", "digest")
    return own | dict(record.keys) | {"body": dict(record.body)}
