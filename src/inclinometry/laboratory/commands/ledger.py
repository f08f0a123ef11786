"""Commands of the ledger: make, verify, export, import, back up, look into."""

from __future__ import annotations

import getpass
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from inclinometry.cli import output
from inclinometry.cli.options import Flag, InputOrNone, Json
from inclinometry.errors import refused
from inclinometry.findings import Finding
from inclinometry.laboratory.commands import LedgerAddress
from inclinometry.laboratory.ledger import exchange
from inclinometry.laboratory.ledger.admin import create
from inclinometry.laboratory.ledger.chain import parse_head
from inclinometry.laboratory.ledger.exchange import restore
from inclinometry.laboratory.ledger.keys import fingerprint, read_public
from inclinometry.laboratory.ledger.ledger import Ledger, default_path
from inclinometry.laboratory.ledger.users import User, change_password, find_user, guard_last_administrator, put_user
from inclinometry.laboratory.ledger.users import remove_second_factor as without_second_factor
from inclinometry.laboratory.ledger.users import users as all_users
from inclinometry.laboratory.ledger.verify import verify as verify_ledger
from inclinometry.laboratory.ledger.witness import others
from inclinometry.laboratory.results import history as history_of


def _where(given: str | None) -> str:
    return str(default_path()) if given is None else given


def init(
    where: str | None = None, /, *, clock: str | None = None, accept: str | None = None, unsigned: Flag = False
) -> None:
    """Make an empty ledger, or bring an old one up to date; its heads are signed by the laboratory's key.

    Parameters
    ----------
    where
        SQLite file, or postgresql://user:password@host/database. If not given, the one in the user's data folder.
    clock
        Reason to continue if the last record's time is in the future because the clock was wrong; recorded.
    accept
        Accept a fault found by `ledger verify`: what happened (for example a backup was restored). It is recorded; the
        ledger continues from its present content.
    unsigned
        Do not sign: anyone who can write to the database can then change it without a trace.
    """
    answered = accept is not None and accept.strip() != ""
    with create(_where(where), sign=not unsigned, accepted=answered) as ledger:
        if clock is not None:
            ledger.correct_clock(clock, author=_who())
        if accept is not None:
            ledger.accept(accept, author=_who())
        output.print_line(f"ledger {ledger.shown} holds {output.counted(ledger.head().seq, 'record')}")
        for place in others(ledger.keys.folder) if ledger.head().seq else ():
            ledger.record_witness(place, "named", author=_who())
        signed = ledger.signed_head()
        if signed is not None:
            output.print_line(f"signed by the key {fingerprint(signed.key)} in {ledger.keys.folder}")


def verify(
    *,
    ledger: LedgerAddress = None,
    head: str | None = None,
    certificate: str | None = None,
    key: InputOrNone = None,
    copy: Flag = False,
    json: Json = False,
) -> int:
    """Check every record, the chain, signed heads and witnesses: exit status 0 proven, 1 changed or not proven (a
    witness that was named does not answer, another key than the one here signed it), 2 bad input. A ledger that was
    never signed, as far as is known here, ends with 0 too, unless --key is given: nothing in it is proven.

    Parameters
    ----------
    head
        NUMBER:DIGITS from an earlier check or a certificate.
    key
        Public key of the laboratory, if not that of this computer.
    copy
        This is a copy: later records of the ledger are reported and are no fault.
    certificate
        Number of a certificate: check its files, record and calibration instead of the whole ledger.
    """
    if certificate is not None:
        if head is not None or copy:
            raise refused("input-not-with", {"name": "--certificate", "other": "--head, --copy"})
        return _certificate(_where(ledger), certificate, json)
    noted = None if head is None else parse_head(head)
    with Ledger(_where(ledger), read_only=True) as opened, output.working("verifying") as progress:
        public = () if key is None else read_public(key).keys
        found = verify_ledger(opened, head=noted, public=public, copy=copy, progress=progress)
    output.findings((*found.faults, *found.silent, *found.findings), notes=True)
    if json:
        plain = {
            name: getattr(found, name)
            for name in ("ok", "proven", "compared", "records", "documents", "faults", "silent", "findings")
        }
        signed = None if found.signed is None else found.signed.statement()
        output.print_json(plain | {"head": str(found.head), "signed": signed})
        return 0 if found.unsuspected else 1
    if found.ok:
        records, documents = output.counted(found.records, "record"), output.counted(found.documents, "document")
        alone = "" if found.proven else " by what the ledger itself says"
        output.print_line(f"{records} and {documents} are sound{alone}")
        output.print_line(f"head {found.head}")
        if not found.silent:
            return 0 if found.unsuspected else 1
        who = "a witness" if len(found.silent) == 1 else f"{len(found.silent)} witnesses"
        output.print_line(
            f"not proven: {who} did not answer, and a cut tail or an older copy may be known there alone; verify again "
            "when it answers, or take it off with `inclinometry ledger witness PLACE --remove`"
        )
        return 1
    of_keys = all(fault.code in ("key-public-other", "key-damaged") for fault in found.faults)
    what = "the laboratory's keys are not what they were" if of_keys else "this ledger was changed behind its back"
    output.print_line(f"{output.counted(len(found.faults), 'fault')}: {what}")
    return 1


def _certificate(where: str, number: str, json: bool) -> int:
    """One certificate against the ledger."""
    from inclinometry.laboratory.certificates import digest_of, status, verify_certificate

    with Ledger(where, read_only=True) as opened:
        found = status(opened, number)
        problems = verify_certificate(opened, number)
    digest, end = digest_of(found.record), 1 if problems else 0
    output.findings(problems)
    if json:
        output.print_json({"ok": not problems, "state": found.state, "digest": digest, "problems": problems})
        return end
    if not problems:
        output.print_line(f"certificate {number} ({found.state}): files, record and calibration agree")
    output.print_line(f"digest of its record {digest}; compare it with the one on paper")
    return end


def export(target: Path, /, *, ledger: LedgerAddress = None) -> None:
    """Write everything into one file, which another computer can import.

    Parameters
    ----------
    target
        File to write, a ZIP.
    """
    where = _where(ledger)
    output.check_outputs({"the export": target}, {"--ledger": path_of(where)})
    with Ledger(where, read_only=True) as opened, output.working("exporting") as progress:
        head = exchange.export(opened, target, progress=progress)
    output.print_line(f"{output.counted(head.seq, 'record')} written to {target}")
    output.print_line(f"head {head}")


def import_(source: Path, /, *, ledger: LedgerAddress = None) -> None:
    """Read an export into an empty ledger, made when it is not there; everything is checked, and recorded as a whole or
    not at all.

    Parameters
    ----------
    source
        File written by `ledger export`.
    """
    where = _where(ledger)
    path = path_of(where)
    made = path is not None and not path.exists()
    try:
        with create(where) as opened, output.working("importing") as progress:
            head = restore(opened, source, progress=progress)
            output.print_line(f"{output.counted(head.seq, 'record')} imported into {opened.shown}")
            output.print_line(f"head {head}")
    except BaseException:
        if made and path is not None:  # nothing was imported: no empty ledger is left behind
            for end in ("", "-wal", "-shm"):
                path.with_name(path.name + end).unlink(missing_ok=True)
        raise


def backup(target: Path, /, *, ledger: LedgerAddress = None) -> None:
    """Copy the ledger as it is now into a new file; work may go on meanwhile.

    Parameters
    ----------
    target
        File to write; it must not exist.
    """
    where = _where(ledger)
    output.check_outputs({"the backup": target}, {"--ledger": path_of(where)})
    with Ledger(where, read_only=True) as opened, output.busy("backing up"):
        exchange.backup(opened, target)
    output.print_line(f"{where} copied to {target}")


def history(serial: str, /, *, ledger: LedgerAddress = None, json: Json = False) -> None:
    """How the parameters of a tool went from calibration to calibration.

    Parameters
    ----------
    serial
        Serial number of the tool.
    """
    with Ledger(_where(ledger), read_only=True) as opened:
        found = history_of(opened, serial)
    days = [day.isoformat() for day in found.measured]
    if json:
        pairs = {name: {"value": found.values[name], "u": found.u[name]} for name in found.values}
        about = {"serial": found.serial, "measured": days, "created": found.created, "calibrations": found.records}
        output.print_json(about | {"parameters": pairs})
        return
    rows = []
    for name in found.values:
        change, spread = found.change(name)
        last = f"{change[-1]:+.3g}"
        ratio = abs(change[-1]) / spread[-1] if len(found) > 1 and spread[-1] > 0.0 else 0.0
        mark = "!" if ratio > 3.0 else ""
        rows.append([name, f"{found.values[name][-1]:.7g}", f"{found.u[name][-1]:.2g}", last, f"{ratio:.1f}{mark}"])
    output.table(
        f"{found.serial}: {output.counted(len(found), 'calibration')}, {days[0]} to {days[-1]}",
        ["parameter", "last", "u", "change", "change/u"],
        rows,
        caption="change since the first calibration; ! beyond three standard uncertainties",
    )
    if kinds := found.scale_unknown[-1]:
        output.findings([Finding("session-scale-unknown", {"kinds": tuple(kinds)})])


def users(
    name: str | None = None,
    /,
    *,
    ledger: LedgerAddress = None,
    role: Literal["operator", "metrologist", "auditor", "administrator"] | None = None,
    full_name: str | None = None,
    language: Literal["en", "ru", "zh"] | None = None,
    password: Flag = False,
    disable: Flag = False,
    enable: Flag = False,
    remove_second_factor: Flag = False,
    json: Json = False,
) -> None:
    """List the users, or add or change one; the password is asked for, or taken from INCLINOMETRY_PASSWORD.

    Parameters
    ----------
    name
        User to add or change. Default: list all.
    role
        operator captures, metrologist also issues certificates, administrator also keeps users, auditor reads; that of
        Default: the user is kept.
    full_name
        Name on certificates. Default: keep.
    language
        Language of the pages. Default: keep; en for a new user.
    password
        Ask for a new password.
    disable
        The user may no longer log in.
    enable
        The user may log in again.
    remove_second_factor
        Log in by password only, if telephone and recovery codes are lost.
    """
    if disable and enable:
        raise refused("input-not-with", {"name": "--disable", "other": "--enable"})
    with Ledger(_where(ledger), read_only=name is None) as opened:
        if name is not None:
            old = find_user(opened, name)
            if old is None and role is None:
                raise refused("input-missing", {"names": ("--role",)})
            known = old or User(name, "", str(role), True, "en")
            new = replace(
                known,
                role=role or known.role,
                full_name=known.full_name if full_name is None else full_name,
                active=enable or (known.active and not disable),
                language=language or known.language,
            )
            if known.may("administer"):
                guard_last_administrator(opened, name, new.role, new.active)
            secret = _ask(f"password of {name}") if password or old is None else None
            about: dict[str, Any] = {"full_name": new.full_name, "active": new.active, "language": new.language}
            put_user(opened, name, role=new.role, author=_who(), password=secret, **about)
            if remove_second_factor:
                without_second_factor(opened, name, author=_who())
        found = all_users(opened)
    if json:
        fields = ("name", "role", "active", "full_name")
        output.print_json([{name: getattr(u, name) for name in fields} for u in found])
        return
    rows = [[u.name, u.role, "yes" if u.active else "no", u.full_name] for u in found]
    output.table("users", ["name", "role", "active", "full name"], rows)


def password(name: str, /, *, ledger: LedgerAddress = None) -> None:
    """Change your own password; the current one and the new one are asked for.

    A script puts them into the environment as INCLINOMETRY_PASSWORD and INCLINOMETRY_NEW_PASSWORD. An administrator
    sets a new password with `ledger users NAME --password`.

    Parameters
    ----------
    name
        The user.
    """
    with Ledger(_where(ledger)) as opened:
        current = _ask(f"current password of {name}", once=True)
        change_password(opened, name, current, _ask(f"new password of {name}", "INCLINOMETRY_NEW_PASSWORD"))
    output.print_line(f"the password of {name} was changed; its logins at a bench end")


def _ask(what: str, variable: str = "INCLINOMETRY_PASSWORD", *, once: bool = False, word: str = "password") -> str:
    """A password that is nowhere on the command line, where others could read it."""
    given = os.environ.get(variable)
    if given is not None:
        return given
    if not sys.stdin.isatty():
        raise refused("web-no-terminal", {"what": word, "variable": variable})
    first = getpass.getpass(f"{what}: ")
    if not once and getpass.getpass("again: ") != first:
        raise refused("web-differ")
    return first


def _who() -> str:
    """The user of this computer: whoever changes a ledger from the command line is recorded with it."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # no name for this user on the system
        return f"uid {os.getuid()}" if hasattr(os, "getuid") else "command line"


def path_of(where: str) -> Path | None:
    """The file of a ledger; None where a server keeps it."""
    return None if "://" in where else Path(where)
