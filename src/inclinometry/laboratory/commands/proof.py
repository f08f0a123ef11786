"""Commands: ledger key, head and witness; what proves a ledger to those who do not hold it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.hashes import SHA256

from inclinometry.cli import output
from inclinometry.cli.options import AlsoWritten, Flag, InputOrNone, Json, Output, OutputOrNone
from inclinometry.errors import InputError, not_among, refused
from inclinometry.files.json_codec import canonical
from inclinometry.files.writing import write_bytes
from inclinometry.findings import Finding
from inclinometry.laboratory.commands import LedgerAddress
from inclinometry.laboratory.commands.ledger import _ask, _where, _who, path_of
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.engine import default_path, shown
from inclinometry.laboratory.ledger.heads import check_extension, proof_since, read_head
from inclinometry.laboratory.ledger.keys import Keys, fingerprint, read_public
from inclinometry.laboratory.ledger.ledger import Ledger, send
from inclinometry.laboratory.ledger.witness import PRINT, name_others, others, witnessed


def key(
    *,
    make: Flag = False,
    public: AlsoWritten = None,
    rotate: str | None = None,
    lost: str | None = None,
    passphrase: Flag = False,
    json: Json = False,
) -> None:
    """The laboratory's key, which signs ledgers and certificates. Kept outside every ledger.

    Parameters
    ----------
    make
        Make a key if there is none (`ledger init` does it too).
    public
        Write the public key, with which others check this laboratory's ledgers and certificates.
    rotate
        Reason: a new key replaces the old one, which signs it.
    lost
        How the key was lost: a new one is made, unsigned; each ledger states this from then on.
    passphrase
        Ask for a passphrase to encrypt the key; empty for none. In scripts: INCLINOMETRY_NEW_PASSPHRASE, and
        INCLINOMETRY_KEY_PASSPHRASE for the present one.
    """
    if rotate is not None and lost is not None:
        raise refused("input-not-with", {"name": "--lost", "other": "--rotate"})
    keys = Keys()
    if make:
        keys.make()
    if rotate is not None:
        keys.rotate(rotate)
    if lost is not None:
        keys.begin_anew(lost)
    if passphrase:
        keys.set_passphrase(_ask("new passphrase", "INCLINOMETRY_NEW_PASSPHRASE", word="passphrase"))
    found = keys.public()
    if found is None:
        raise refused("key-none", {"folder": str(keys.folder)})
    uncompared = keys.uncompared()
    told = [uncompared] if uncompared else []
    if public is not None:
        from inclinometry.laboratory.certificate.signing import of_authority, public_bundle

        write_bytes(public_bundle(keys), public)
        abouts = [
            {"subject": one.subject.rfc4514_string(), "digest": one.fingerprint(SHA256()).hex()}
            for one in of_authority(keys)
        ]
        told += [Finding("session-document-foreign", about) for about in abouts]
    output.findings(told)
    if json:
        about = {"folder": str(keys.folder), "public": found, "fingerprint": fingerprint(found)}
        compared = not uncompared if keys.there else None
        output.print_json(about | {"compared": compared, "changes": keys.changes(), "witnesses": others(keys.folder)})
        return
    output.print_line(f"key {fingerprint(found)} in {keys.folder}")
    for one in keys.changes():
        output.print_line(_change(one))
    if public is not None:
        output.print_line(f"public key written to {public}")


def _change(one: Mapping[str, Any]) -> str:
    what = "took the place of" if one["action"] == "rotated" else "was begun, lost was"
    before = fingerprint(one["before"]) if one["before"] else "one that is not known"
    return f"{one['time'][:10]}: {fingerprint(one['after'])} {what} {before} ({one['reason']})"


def head(
    file: InputOrNone = None,
    /,
    *,
    ledger: LedgerAddress = None,
    output_: OutputOrNone = None,
    since: InputOrNone = None,
    key: InputOrNone = None,
    json: Json = False,
) -> int:
    """The signed head of a ledger; or check the file of one. Exit status 0 sound, 1 not.

    Parameters
    ----------
    file
        An exported signed head, to check without the ledger.
    output_
        Write the signed head, JSON.
    since
        An earlier signed head: adds the proof that the ledger only grew since then; with FILE, checks that proof.
    key
        Public key of the laboratory, to check FILE.
    """
    if file is not None:
        return _check(file, since, key, json)
    where = _where(ledger)
    output.check_outputs({"--output": output_}, {"--since": since, "--ledger": path_of(where)})
    with Ledger(where, read_only=True) as opened:
        newest = opened.own_head()
        if newest is None:
            raise LedgerError(Finding("ledger-unsigned", {"ledger": opened.shown}))
        content: dict[str, Any] = {**newest.statement(), "changes": opened.keys.changes()}
        if since is not None:
            old, _ = read_head(since)
            if old.ledger != newest.ledger or old.size > newest.size:
                about = {"file": str(since), "ledger": old.ledger, "own": str(newest)}
                raise refused("web-heads-apart", {**about, "size": old.size})
            with opened.snapshot() as connection:
                proof = proof_since(connection, old.size, newest.size)
            content["consistency"] = {"from": old.size, "proof": proof}
    if output_ is not None:
        write_bytes(canonical(content), output_)
    if json:
        output.print_json(content)
    else:
        output.print_line(f"head {newest}")
        output.print_line(f"signature {newest.signature}")
    return 0


def _check(file: Path, since: Path | None, key: Path | None, json: bool) -> int:
    found, content = read_head(file)
    public = None if key is None else read_public(key).keys[0]
    old = found if since is None else read_head(since)[0]
    problem = check_extension(old, found, content, public)
    output.findings([] if problem is None else [problem])
    if json:
        output.print_json({"ok": not problem, "problem": problem, "size": found.size, "ledger": found.ledger})
        return 1 if problem else 0
    output.print_line(f"{'not ' if problem else ''}genuine: head {found}")
    if not problem and since is not None:
        output.print_line(f"the ledger of {found.size} records begins with the {old.size} of {old.time[:19]}")
    if public is None:
        output.print_line("no public key was given: compare the fingerprint of the key with the laboratory's")
    return 1 if problem else 0


def status(*numbers: str, ledger: LedgerAddress = None, output_: Output) -> None:
    """Write how certificates stand, signed, for those who hold a certificate and not the ledger.

    Parameters
    ----------
    numbers
        Numbers of certificates; all if none is given.
    output_
        Write JSON: the newest signed head, the status of each certificate (issued, void, superseded), each accepted
        break, and their proofs.
    """
    from inclinometry.laboratory.certificate.status import break_of, make_status

    where = _where(ledger)
    output.check_outputs({"--output": output_}, {"--ledger": path_of(where)})
    with Ledger(where, read_only=True) as opened:
        made = make_status(opened, numbers)
    write_bytes(canonical(made), output_)
    states = [one["state"] for one in made["certificates"]]
    order = [state for state in ("issued", "void", "superseded") if state in states]
    listed = ", ".join(f"{states.count(state)} {state}" for state in order)
    output.print_line(
        f"{output.counted(len(states), 'certificate')} as of record {made['head']['size']}: {listed or 'none'}"
    )
    for one in made["accepted"]:
        output.print_line(str(break_of(one)))
    output.print_line(f"written to {output_}")


def witness(place: str | None = None, /, *, ledger: LedgerAddress = None, remove: Flag = False) -> int:
    """Where signed heads are kept beside this computer. Exit status 1: one of them keeps nothing of the ledger, or
    cannot be read.

    Parameters
    ----------
    place
        A folder, another ledger, or print: new heads are written there and `ledger verify` reads them. Without it the
        places are listed.
    remove
        Remove the place from the list; its content stays. The removal is recorded and signed; `ledger verify` reports a
        place removed in another way.
    """
    keys = Keys()
    if place is not None and remove:
        _remove(keys, place, ledger)
    elif place is not None:
        _name(keys, place, _where(ledger))
    output.print_line(f"{keys.folder / 'heads'} (this computer)")
    for one in others(keys.folder):
        output.print_line(shown(one))
    where = _where(ledger)
    if ledger is None and not default_path().is_file():
        return 0
    with Ledger(where, read_only=True) as opened:
        newest = opened.signed_head()
    if newest is None or newest.key != keys.public() or not keys.there:
        return 0
    _, silent, lost = witnessed(keys.folder, newest.ledger, where)
    output.findings([*silent, *lost])
    return 1 if lost or silent else 0


def _absolute(place: str) -> str:
    return place if place == PRINT or "://" in place else str(Path(place).resolve())


def _name(keys: Keys, place: str, where: str) -> None:
    """Put a place on the list, and into the ledger that it was put there."""
    absolute, named = _absolute(place), others(keys.folder)
    with Ledger(where) as opened:
        newest = opened.signed_head()
        if newest is not None:  # a place that cannot be used is not written down
            send(absolute, newest, where, keys.folder)
        if absolute not in named:
            name_others(keys.folder, [*named, absolute])
        try:
            opened.record_witness(absolute, "named", author=_who())
        except InputError:
            name_others(keys.folder, named)
            raise


def _remove(keys: Keys, place: str, ledger: str | None) -> None:
    """Take a place off the list, when the ledger says so; also one that another user has taken off."""
    named = others(keys.folder)
    found = next((one for one in (place, _absolute(place)) if one in named), None)
    before = after = None
    if ledger is not None or default_path().is_file():
        with Ledger(_where(ledger)) as opened:
            before = opened.head().seq
            opened.record_witness(found or _absolute(place), "removed", author=_who())
            after = opened.head().seq
    if found is None and before == after:
        raise not_among("PLACE", place, named)
    name_others(keys.folder, [one for one in named if one != found])
