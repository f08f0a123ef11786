"""Commands: ledger enter and void, calibrations made elsewhere brought in and certified, certificates ended."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import Flag, InputOrNone, Json
from inclinometry.cli.stand import UNKNOWN, USUAL_DIALS, USUAL_FIT, DialOptions, FitOptions, LeftHanded, StandOptions
from inclinometry.earth.site import Site
from inclinometry.errors import FileError, InputError, in_file, out_of_range, refused
from inclinometry.files.site_toml import read_site
from inclinometry.findings import Finding
from inclinometry.laboratory import certificates, registry
from inclinometry.laboratory.certificate.laboratory import Laboratory, begun
from inclinometry.laboratory.certificate.laboratory_toml import read_laboratory, read_logo
from inclinometry.laboratory.certificate.requirements import open_warnings
from inclinometry.laboratory.commands import LedgerAddress
from inclinometry.laboratory.commands.ledger import _where, _who
from inclinometry.laboratory.drift import DOSES
from inclinometry.laboratory.import_file import LARGEST, import_file, try_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger, Record
from inclinometry.laboratory.placeholders import stated
from inclinometry.laboratory.results import finish_calibration
from inclinometry.opening import whole
from inclinometry.workflow.calibrate import Options


def enter(
    file: Path,
    /,
    *,
    serial: str,
    performed: str,
    rig: str,
    ledger: LedgerAddress = None,
    site: Annotated[str | None, Parameter(group=options.INPUT)] = None,
    stand: StandOptions = UNKNOWN,
    fit: FitOptions = USUAL_FIT,
    dials: DialOptions = USUAL_DIALS,
    left_handed: LeftHanded = False,
    type_: Annotated[str | None, Parameter(name="--type")] = None,
    hours: float = 0.0,
    shock: float = 0.0,
    heat: float = 0.0,
    certify: Flag = False,
    laboratory: InputOrNone = None,
    supersedes: str | None = None,
    reason: str | None = None,
    accept_warnings: str = "",
    json: Json = False,
) -> None:
    """Bring a calibration made elsewhere into the ledger: bench readings, which are fitted, or tool.json.

    Readings are fitted as `calibrate` fits them, by the joint method. A tool and a rig that are not registered are
    registered; nothing is recorded of a file that is refused.

    Parameters
    ----------
    file
        Bench readings as for `calibrate`, or its tool.json.
    serial
        Serial number of the tool.
    performed
        Day of the measurement, YYYY-MM-DD; the calibration is valid from then.
    rig
        Name of the stand. A new one is registered with --rig-sd-deg and the dial options; a registered one keeps its
        own.
    site
        Name of a registered site, or site.toml with g, b_nT, dip_deg, latitude_deg of the stand. Dip and latitude set
        the signs of the fields.
    type_
        Type of the tool, to register it; tools of one type share a drift model.
    hours
        Operating hours since the previous calibration.
    shock
        Shock since then: a count, or an integral above a level.
    heat
        Heat since then: hours above a temperature.
    certify
        Also issue a certificate; without a verification it states no conformity.
    laboratory
        lab.toml, for the certificate.
    supersedes
        Number of the certificate that this one replaces.
    reason
        Reason; it is recorded.
    accept_warnings
        Reason to certify with open warnings; recorded and printed on the certificate.
    """
    day, doses = performed_on(performed), doses_of(hours, shock, heat)
    if supersedes is not None and not stated(reason or ""):
        raise refused("input-needs", {"name": "--supersedes", "needed": ("--reason",)})
    if (certify or supersedes) and laboratory is None:
        raise refused("input-needs", {"name": "--certify", "needed": ("--laboratory",)})
    known = read_laboratory(laboratory)[0] if laboratory is not None else None
    readings, wishes = _content(file), Options(left_handed=left_handed, name=serial, **vars(fit), **vars(stand))
    with create(_where(ledger)) as opened:
        about_rig, tool = _rig(opened, rig, wishes, dials), registry.find_tool(opened, serial)
        if type_ is not None and tool is not None and tool.name != type_:
            raise refused("session-other-type", {"serial": serial, "registered": tool.name, "type": type_})
        known_site = None if site is None else registry.find_site(opened, site)
        where = known_site if site is None or known_site is not None else _site_file(site)
        wishes = replace(wishes, rig_sd=None, azimuth_sd=None, inclination_sd=None, toolface_sd=None)
        try:
            with output.reading(file), output.busy("calibrating"):
                tried = try_file(readings, about_rig, where, wishes)
            if (certify or supersedes) and not stated(accept_warnings) and (unsettled := open_warnings(tried, None)):
                raise refused("certificate-open-warnings", {"finding": tuple(unsettled)})
            if registry.find_rig(opened, rig) is None:
                registry.put_rig(opened, about_rig, author=_who())
            if tool is None:
                registry.put_tool(opened, registry.RegisteredTool(serial, type_ or serial), author=_who())
            at = {"fields": where} if known_site is None else {"site": known_site.name}
            said: dict[str, Any] = {"options": wishes, "performed": day, "doses": doses, **at}
            found = import_file(opened, readings, serial, rig, author=_who(), **said)
        except FileError as error:
            raise in_file(error, file) from None
        if found.kind == "session":
            with output.busy("calibrating"):
                found = finish_calibration(opened, found.id, author=_who())
        number = None
        if certify or supersedes:
            number = certified(opened, found, known, supersedes, reason or "", accept_warnings)
    output.findings(tried.findings)
    if json:
        content = {"serial": serial, "calibration": found.id, "certificate": number}
        output.print_json(content | {"findings": tried.findings})
        return
    output.print_line(
        f"{serial}: calibration {found.id} of {day} recorded{f', certificate {number}' if number else ''}"
    )


def _rig(ledger: Ledger, name: str, stated: Options, dials: DialOptions) -> registry.RegisteredRig:
    """The rig as registered, or as it is to be registered; what contradicts a registered one is refused."""
    known = registry.find_rig(ledger, name)
    each = (stated.azimuth_sd, stated.inclination_sd, stated.toolface_sd)
    if known is None:
        azimuth, inclination, toolface = (stated.rig_sd if one is None else one for one in each)
        if azimuth is None or inclination is None or toolface is None:
            raise refused("input-needs", {"name": f"--rig {name}", "needed": ("--rig-sd-deg",)})
        return registry.RegisteredRig(name, (azimuth, inclination, toolface), dials=dials.dials())
    rounded = 1e-10  # of a standard deviation in the record, rad
    stated_sd = [stated.rig_sd if one is None else one for one in each]
    other = any(one is not None and abs(one - sd) > rounded for one, sd in zip(stated_sd, known.sd, strict=True))
    if other or replace(known.dials, **dials.given()) != known.dials:
        degrees = tuple(float(one) for one in np.degrees(known.sd))
        raise refused("session-other-rig", {"rig": name, "sd_deg": degrees, "dials": str(known.dials.way)})
    return known


def _site_file(path: str) -> Site:
    if not Path(path).exists():
        raise registry.not_registered("site", path)
    return read_site(path)


def _content(file: Path) -> bytes:
    content = whole(file, LARGEST)
    if not content:
        raise FileError(Finding("file-empty", {"what": "readings"}), path=file)
    return content


def performed_on(performed: str) -> date:
    """The day of a measurement."""
    return begun(options.day(performed, "--performed"), "--performed")


def doses_of(hours: float, shock: float, heat: float) -> dict[str, float]:
    """What a tool did since its calibration before, by the names of `DOSES`."""
    found = dict(zip(DOSES, (hours, shock, heat), strict=True))
    for name, value in found.items():
        if not 0.0 <= value < 1e9:
            raise out_of_range(f"--{name}", value, ">= 0")
    return found


def certified(
    ledger: Ledger,
    calibration: Record,
    known: Laboratory | None,
    supersedes: str | None,
    reason: str,
    accept_warnings: str = "",
) -> str:
    """Number of the certificate issued for a calibration, in place of another where one is named."""
    said: dict[str, Any] = {
        "author": _who(),
        "accept_warnings": accept_warnings,
        "supersedes": supersedes,
        "reason": reason,
    }
    try:
        with output.busy("setting the certificate"):
            made = certificates.issue(ledger, calibration.id, None, known, **said)
    except InputError as error:
        why = error.finding
        raise refused("session-not-issued", {"calibration": calibration.id, "finding": why}) from None
    return str(made.keys["number"])


def void(number: str, /, *, reason: str, ledger: LedgerAddress = None) -> None:
    """Declare a certificate void. It stays in the ledger, with the reason.

    Parameters
    ----------
    number
        Number of the certificate.
    reason
        Reason; it is recorded.
    """
    with Ledger(_where(ledger)) as opened:
        found = certificates.void(opened, number, reason, author=_who())
    output.print_line(f"certificate {number} is {found.state}")


def laboratory(
    file: Path | None = None, /, *, logo: InputOrNone = None, ledger: LedgerAddress = None, json: Json = False
) -> None:
    """Record what the laboratory says of itself on certificates, from lab.toml; without a file, show it.

    The bench and every lab.toml that names this ledger (`ledger = "lab.sqlite"`) use it.

    Parameters
    ----------
    file
        lab.toml: name, address, country, accreditation, procedure and so on, and [[standards]].
    logo
        PNG or SVG, up to 200 kB. Default: keep the recorded one.
    """
    if file is None and logo is not None:
        raise refused("input-needs", {"name": "--logo", "needed": ("lab.toml",)})
    if file is not None:
        known, _, used = read_laboratory(file)
        picture = whole(logo, registry.LARGEST_LOGO) if logo is not None else read_logo(file)
        with create(_where(ledger)) as opened:
            registry.put_laboratory(opened, known, author=_who(), logo=picture)
            for one in used:
                registry.put_standard(opened, one, author=_who())
    with Ledger(_where(ledger), read_only=True) as opened:
        found, there, registered = (
            registry.find_laboratory(opened),
            registry.find_logo(opened),
            registry.standards(opened),
        )
    settings = {} if found is None else {name: text for name, text in vars(found).items() if text}
    today = datetime.now(UTC).date()
    late = [one.name for one in registered if one.overdue(today) and not one.retired]
    output.findings([Finding("web-standard-due", {"name": name}) for name in late])
    if json:
        rows = [{"name": s.name, "certificate": s.certificate, "due": s.due and s.due.isoformat()} for s in registered]
        output.print_json({**settings, "logo": there is not None, "standards": rows})
        return
    for name, text in settings.items():
        output.print_line(f"{name}: {text}")
    for line in (one.cited for one in registered):
        output.print_line(f"reference standard: {line}")
    output.print_line("logo: " + ("none" if there is None else f"{len(there[1])} bytes"))
