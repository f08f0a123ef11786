"""Somebody writes to ledger and key folder and has no key: what he signs with an own key is never the laboratory's."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from tests.refusals import coded, fits, refused

from inclinometry.laboratory.certificate.signing import public_bundle
from inclinometry.laboratory.certificate.status import make_status
from inclinometry.laboratory.ledger import chain
from inclinometry.laboratory.ledger.heads import signed_by
from inclinometry.laboratory.ledger.keys import PASSPHRASE, Keys, fingerprint, public_pem, read_public
from inclinometry.laboratory.ledger.ledger import Ledger, LedgerError
from inclinometry.laboratory.ledger.merkle import Tree, leaf_hash
from inclinometry.laboratory.ledger.verify import Verdict, verify
from inclinometry.laboratory.ledger.witness import place_of

from .conftest import add, relinked, rewrite


def forge(path: Path, folder: Path, *, ledger: bool = True, heads: bool = True, public: bool = True) -> str:
    """Another author of record 2, every digest, link, root and signature right; the forger's public key."""
    forger = Keys(folder.parent / "forger").make()
    with Ledger(path, keys=Keys(folder)) as opened:
        newest, rows = opened.signed_head(), relinked(opened, 2 if ledger else 0)
    kept, leaves, changes = [], [], []
    for seq, kind, name, created, digest, link in rows:
        leaves.append(leaf_hash(chain.leaf(seq, kind, name, created, digest)))
        head = signed_by(forger, newest.ledger, chain.Head(seq, link), Tree(leaves).root(), created)
        kept.append(chain.compact({**head.statement(), "where": place_of(str(path))}) + "\n")
        changes.append(f"UPDATE head SET root = '{head.root}', link = '{head.link}', key = '{head.key}', signature = "
                       f"'{head.signature}', created = '{head.time}' WHERE seq = {seq}")  # fmt: skip
    if ledger:
        rewrite(path, 2, *changes, "DELETE FROM head WHERE seq = 0")
    if heads:
        (folder / "heads" / f"{newest.ledger}.jsonl").write_text("".join(kept))
    if public:
        (folder / "public.pem").write_bytes(public_pem(forger.public))
    return forger.public


def whose(found: Verdict) -> list[str]:
    """Whose key signed it, as verification has it."""
    return [str(one.values["whose"]) for one in found.findings if one.code == "key-signed"]


def test_a_forger_with_an_own_key_is_named(path: Path, keys: Keys) -> None:
    """Ledger, witness and public.pem are of one key, and right: only key.pem says whose they are not."""
    own = keys.signing().public
    forger = forge(path, keys.folder)
    with Ledger(path, keys=Keys(keys.folder)) as ledger:
        found = verify(ledger)
        assert (found.ok, found.proven, found.compared) == (False, False, True)
        prints = {"key": fingerprint(forger), "own": fingerprint(own)}
        assert fits(found.faults[0], ["key-public-other"], prints)
        prints = {"key": fingerprint(forger), "expected": fingerprint(own)}
        assert any(fits(one, ["key-not-laboratory"], prints) for one in found.faults)
        assert "the laboratory's" not in whose(found)
        # with the forger's key given, public.pem is named all the same
        assert not verify(ledger, public=[forger]).ok
        for act in (
            lambda: add(ledger, "NEXT"),
            lambda: ledger.accept("nothing happened", author="anna"),
            lambda: ledger.record_witness("print", "named", author="anna"),
            lambda: make_status(ledger),
            ledger.own_head,
            ledger.keys.public,
            ledger.keys.make,
            lambda: ledger.keys.rotate("every year"),
            lambda: ledger.keys.begin_anew("stolen"),
            lambda: public_bundle(ledger.keys),
        ):
            with refused("key-public-other", error=LedgerError):
                act()
        assert ledger.head().seq == 8
    # the remedy restores the public key; the heads stay a fault
    (keys.folder / "public.pem").unlink()
    assert keys.public() == own
    keys.make()
    assert read_public(keys.folder / "public.pem").keys == (own,)
    with Ledger(path, keys=keys) as ledger:
        assert coded(verify(ledger).faults) == ["key-not-laboratory"]
        for act in (ledger.own_head, lambda: add(ledger, "NEXT")):
            with refused("key-other", error=LedgerError):
                act()


@pytest.mark.parametrize("what", ["public", "heads"])
def test_each_part_of_another_key_is_named(path: Path, keys: Keys, what: str) -> None:
    """public.pem alone; the file of the witness alone, though its heads are those of the ledger."""
    forger = forge(path, keys.folder, ledger=False, heads=what == "heads", public=what == "public")
    with Ledger(path, keys=keys) as ledger:
        found = verify(ledger)
        assert not found.ok
        wanted = {"public": "key-public-other", "heads": "key-not-laboratory"}[what]
        assert fits(found.faults[0], [wanted], {"key": fingerprint(forger)})
        assert what == "public" or "key-witness-agrees" not in coded(found.findings)


@pytest.mark.parametrize("forged", [False, True])
def test_an_encrypted_key_is_not_compared(
    path: Path, keys: Keys, forged: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said, and nothing is called the laboratory's; with the passphrase the forger is named."""
    published = keys.signing().public
    monkeypatch.setenv(PASSPHRASE, "")
    keys.set_passphrase("correct horse")
    if forged:
        forge(path, keys.folder)
    monkeypatch.delenv(PASSPHRASE)
    here = Keys(keys.folder)
    with Ledger(path, keys=here) as ledger:
        found = verify(ledger)
        assert (found.ok, found.proven, found.compared) == (True, False, False)
        (told,) = (one for one in found.findings if one.code == "key-uncompared")
        assert told.values["finding"].code == "key-passphrase"
        assert whose(found) == ["the one in public.pem"]
        given = verify(ledger, public=[published])
        assert (given.ok, given.compared) == (not forged, None)
    monkeypatch.setenv(PASSPHRASE, "correct horse")
    with Ledger(path, keys=Keys(keys.folder)) as ledger:
        found = verify(ledger)
        assert (found.ok, found.compared) == (not forged, True)


def test_where_there_is_no_private_key_the_public_one_is_what_it_is(path: Path, keys: Keys, tmp_path: Path) -> None:
    """Another computer, which only verifies; and a private key whose public one is gone, or that cannot be read."""
    reader = Keys(tmp_path / "reader")
    reader.folder.mkdir()
    shutil.copy(keys.folder / "public.pem", reader.folder)
    with Ledger(path, keys=reader, read_only=True) as ledger:
        found = verify(ledger)
        assert (found.proven, found.compared) == (True, None)
        assert whose(found) == ["the laboratory's"]
        assert ledger.own_head() == ledger.signed_head()
    (keys.folder / "public.pem").unlink()
    with Ledger(path, keys=keys) as ledger:
        assert verify(ledger).compared is True
    keys.path.write_text("nonsense")
    shutil.copy(reader.folder / "public.pem", keys.folder)
    with Ledger(path, keys=Keys(keys.folder)) as ledger:
        found = verify(ledger)
        assert (found.ok, found.proven, found.compared) == (False, False, False)
        assert fits(found.faults[0], ["key-damaged"], {"file": str(keys.path)})
        with refused("key-damaged", error=LedgerError):
            ledger.keys.public()


@pytest.mark.parametrize("action", ["rotate", "begin_anew"])
@pytest.mark.parametrize("last", ["changes.jsonl", "key.pem"])
def test_a_change_of_keys_that_is_cut_short_is_no_forgery(
    keys: Keys, action: str, last: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The power fails behind any step of it: the key that is there is the laboratory's, and signs."""
    keys.make()
    keep = Keys.keep

    def until(self: Keys, name: str, *args: object, **words: object) -> None:
        keep(self, name, *args, **words)  # type: ignore[arg-type]
        if name == last:
            raise OSError("power failed")

    monkeypatch.setattr(Keys, "keep", until)
    with pytest.raises(OSError, match="power failed"):
        getattr(keys, action)("every year")
    monkeypatch.setattr(Keys, "keep", keep)
    found = Keys(keys.folder)
    assert found.public() == found.signing().public == found.make().public
    assert read_public(keys.folder / "public.pem").keys == (found.public(),)
