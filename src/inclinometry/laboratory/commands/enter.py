"""Commands: ledger enter and void, calibrations made elsewhere brought in and certified, certificates ended."""

from __future__ import annotations

from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inclinometry.cli import options, output
from inclinometry.cli.options import Flag, InputOrNone, Json, sd
from inclinometry.errors import FileError, InputError
from inclinometry.laboratory import certificates
from inclinometry.laboratory.certificate.laboratory_toml import Laboratory, begun, read_laboratory, read_logo
from inclinometry.laboratory.commands import LedgerAddress
from inclinometry.laboratory.commands.ledger import _where, _who
from inclinometry.laboratory.drift import DOSES
from inclinometry.laboratory.import_file import LARGEST, import_file
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.ledger import Ledger, Record
from inclinometry.laboratory.registry import (
    LARGEST_LOGO,
    RegisteredRig,
    RegisteredStandard,
    RegisteredTool,
    find_laboratory,
    find_logo,
    find_rig,
    find_tool,
    put_laboratory,
    put_rig,
    put_standard,
    put_tool,
    standards,
)
from inclinometry.laboratory.results import calibration_of, finish_calibration
from inclinometry.opening import whole


def enter(
    file: Path,
    /,
    *,
    serial: str,
    performed: str,
    rig: str,
    ledger: LedgerAddress = None,
    rig_sd_deg: float | None = None,
    type_: Annotated[str | None, Parameter(name="--type")] = None,
    hours: float = 0.0,
    shock: float = 0.0,
    heat: float = 0.0,
    certify: Flag = False,
    laboratory: InputOrNone = None,
    supersedes: str | None = None,
    reason: str | None = None,
    json: Json = False,
) -> None:
    """Bring a calibration made elsewhere into the ledger: bench readings, which are fitted, or tool.json.

    A tool that is not registered is registered with the channels of the file.

    Parameters
    ----------
    file
        Bench readings as `calibrate` takes them, or tool.json as it writes it.
    serial
        Serial number of the tool.
    performed
        Day of the measurement, YYYY-MM-DD: from then on the calibration holds.
    rig
        Name of the stand.
    rig_sd_deg
        Standard deviation of its settings, to register it with; a stand that is registered needs none.
    type_
        Type of the tool, to register it with: tools of one type are taken to drift alike.
    hours
        Operating hours since the calibration before.
    shock
        Dose of shock since then: a count, or an integral above a level.
    heat
        Dose of heat since then: hours above a temperature.
    certify
        Issue a certificate, too; without a verification it states no conformity.
    laboratory
        lab.toml, for the certificate.
    supersedes
        Number of a certificate that this one takes the place of.
    reason
        Why; it is recorded.
    """
    day, doses = performed_on(performed), doses_of(hours, shock, heat)
    if supersedes is not None and not (reason or "").strip():
        raise InputError("--supersedes needs --reason: a certificate is not superseded without one")
    if (certify or supersedes) and laboratory is None:
        raise InputError("a certificate names its laboratory: give --laboratory lab.toml")
    known = read_laboratory(laboratory)[0] if laboratory is not None else None
    content = _content(file)
    with create(_where(ledger)) as opened:
        spread = sd(rig_sd_deg, "--rig-sd-deg")
        if find_rig(opened, rig) is None:
            if spread is None:
                raise InputError(f"rig {rig!r} is not registered; give --rig-sd-deg to register it")
            put_rig(opened, RegisteredRig(rig, (spread, spread, spread)), author=_who())
        tool = find_tool(opened, serial)
        if tool is None:
            put_tool(opened, RegisteredTool(serial, type_ or serial), author=_who())
        elif type_ is not None and tool.name != type_:
            raise InputError(
                f"tool {serial} is registered as of type {tool.name!r}, --type is {type_!r}; change it at the bench"
            )
        try:
            found = import_file(opened, content, serial, rig, author=_who(), performed=day, doses=doses)
        except FileError as error:
            raise FileError(error.problem, path=file, line=error.line) from None
        if found.kind == "session":
            with output.busy("calibrating"):
                found = finish_calibration(opened, found.id, author=_who())
        number = certified(opened, found, known, supersedes, reason or "") if certify or supersedes else None
    if json:
        output.print_json({"serial": serial, "calibration": found.id, "certificate": number})
        return
    output.warnings(calibration_of(found).warnings)
    said = f", certificate {number}" if number else ""
    output.say(f"{serial}: calibration {found.id} of {day} recorded{said}")


def _content(file: Path) -> bytes:
    content = whole(file, LARGEST)
    if not content:
        raise FileError("it is empty; give the file of the measurement", path=file)
    return content


def performed_on(performed: str) -> date:
    """The day of a measurement."""
    return begun(options.day(performed, "--performed"), "--performed")


def doses_of(hours: float, shock: float, heat: float) -> dict[str, float]:
    """What a tool did since its calibration before, by the names of `DOSES`."""
    found = dict(zip(DOSES, (hours, shock, heat), strict=True))
    for name, value in found.items():
        if not 0.0 <= value < 1e9:
            raise InputError(f"--{name} is {value:g}; allowed 0 and more")
    return found


def certified(
    ledger: Ledger, calibration: Record, known: Laboratory | None, supersedes: str | None, reason: str
) -> str:
    """Number of the certificate issued for a calibration, in place of another where one is named."""
    with output.busy("setting the certificate"):
        if supersedes is not None:
            made = certificates.supersede(ledger, supersedes, calibration.id, None, known, reason=reason, author=_who())
        else:
            made = certificates.issue(ledger, calibration.id, None, known, author=_who())
    return str(made.keys["number"])


def void(number: str, /, *, reason: str, ledger: LedgerAddress = None) -> None:
    """Declare a certificate void. It stays in the ledger, with the reason.

    Parameters
    ----------
    number
        Of the certificate.
    reason
        Why; it is recorded.
    """
    with Ledger(_where(ledger)) as opened:
        found = certificates.void(opened, number, reason, author=_who())
    output.say(f"certificate {number} is {found.state}")


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
        PNG or SVG, up to 200 kB; the one recorded before is kept when not given.
    """
    if file is None and logo is not None:
        raise InputError("--logo goes with lab.toml, which says whose it is: give both")
    if file is not None:
        known, _, used = read_laboratory(file)
        picture = whole(logo, LARGEST_LOGO) if logo is not None else read_logo(file)
        with create(_where(ledger)) as opened:
            put_laboratory(opened, known, author=_who(), logo=picture)
            for one in used:
                put_standard(opened, RegisteredStandard(one.name, one.certificate, one.due), author=_who())
    with Ledger(_where(ledger), read_only=True) as opened:
        found, there, registered = find_laboratory(opened), find_logo(opened), standards(opened)
    settings = {} if found is None else {name: text for name, text in vars(found).items() if text}
    today = datetime.now(UTC).date()
    late = [one.name for one in registered if one.overdue(today) and not one.retired]
    output.warnings(
        [f"the reference standard {name} is past its due date: calibrate it before it is used" for name in late]
    )
    if json:
        rows = [
            {"name": one.name, "certificate": one.certificate, "due": one.due and one.due.isoformat()}
            for one in registered
        ]
        output.print_json({**settings, "logo": there is not None, "standards": rows})
        return
    for name, text in settings.items():
        output.say(f"{name}: {text}")
    for line in (one.cited for one in registered):
        output.say(f"reference standard: {line}")
    output.say("logo: " + ("none" if there is None else f"{len(there[1])} bytes"))
