"""The laboratory's Ed25519 key, which signs heads and statements: files outside the database.

A statement is a mapping signed over its canonical JSON; it carries the public key, so that its signature can always be
checked, and whose key that is can be compared.
"""

from __future__ import annotations

import base64
import binascii
import getpass
import hashlib
import json
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from inclinometry.errors import FileError, InputError, refused, system_reason
from inclinometry.findings import Finding
from inclinometry.laboratory.ledger.chain import LedgerError, compact
from inclinometry.laboratory.placeholders import stated
from inclinometry.opening import LARGEST_SETTINGS, whole

FOLDER: Final = "INCLINOMETRY_KEYS"
"""Environment: the folder of the keys, in the place of the one in the user's configuration."""
PASSPHRASE: Final = "INCLINOMETRY_KEY_PASSPHRASE"
"""Environment: the passphrase of the keys. Default: asked for on a terminal."""
CHANGE: Final = "inclinometry/key-change"
BREAK: Final = "inclinometry/accepted-break"
LARGEST_KEY: Final = 1_000_000
"""Bytes of a file of keys, and of certificates."""


def default_folder() -> Path:
    """Where the keys are: in the user's configuration, or where INCLINOMETRY_KEYS says."""
    given = os.environ.get(FOLDER)
    if given:
        return Path(given)
    base = os.environ.get("APPDATA") if os.name == "nt" else os.environ.get("XDG_CONFIG_HOME")
    return Path(base or Path.home() / ".config") / "inclinometry" / "keys"


def fingerprint(public: str) -> str:
    """What people compare of a public key (64 hexadecimal digits): 32 digits of its SHA-256.

    >>> fingerprint("00" * 32)
    '66687aadf862bd776c8fc18b8e9f8e20'
    """
    return hashlib.sha256(bytes.fromhex(public)).hexdigest()[:32]


def signed_bytes(statement: Mapping[str, Any]) -> bytes:
    """What the signature of a statement is over."""
    prefix = b"inclinometry signed statement\n"  # no signature of ours can serve another purpose
    return prefix + compact({name: value for name, value in statement.items() if name != "signature"}).encode()


def right(public: str, signature: str, message: bytes) -> bool:
    """Whether a signature, base64, over bytes is that of a public key, 64 hexadecimal digits."""
    try:
        raw = base64.b64decode(signature, validate=True)
        Ed25519PublicKey.from_public_bytes(bytes.fromhex(public)).verify(raw, message)
    except (InvalidSignature, binascii.Error, ValueError, TypeError):
        return False
    return base64.b64encode(raw).decode() == signature  # one spelling only


def genuine(statement: Mapping[str, Any]) -> bool:
    """Whether a statement bears the signature of the key that it names."""
    try:
        return right(statement["key"], statement["signature"], signed_bytes(statement))
    except (KeyError, TypeError, InputError):
        return False


class KeyFaultError(LedgerError):
    """The keys of the laboratory were exchanged or damaged; `own` is the public key of key.pem, where it is one."""

    own: str | None = None


class NoPrivateKeyError(KeyFaultError):
    """key.pem is no private key."""


class OtherKeyError(KeyFaultError):
    """public.pem holds another key than key.pem beside it."""

    def __init__(self, path: Path, stated: str, own: str) -> None:
        about = {"file": str(path), "key": fingerprint(stated), "own": fingerprint(own)}
        super().__init__(Finding("key-public-other", about))
        self.own = own


class SigningKey:
    """A private Ed25519 key."""

    def __init__(self, private: Ed25519PrivateKey) -> None:
        self.private = private
        self.public: Final = private.public_key().public_bytes_raw().hex()
        """The public key, 64 hexadecimal digits."""

    def sign(self, message: bytes) -> str:
        """Signature over bytes, base64."""
        return base64.b64encode(self.private.sign(message)).decode()

    def statement(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """The content with key and signature."""
        whole = {**content, "key": self.public}
        return {**whole, "signature": self.sign(signed_bytes(whole))}


class Keys:
    """The folder of a laboratory's keys, by default `default_folder()`; read when they are needed.

    key.pem : private key (PKCS 8, mode 0600). public.pem : its public one. changes.jsonl : what was signed when it was
    rotated or lost. accepted.jsonl : accepted breaks of ledgers. document.pem : key that signs documents, with its
    X.509 certificates. heads/ : witness of this computer. witnesses.txt : the other places that heads go to.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        self.folder: Final = default_folder() if folder is None else Path(folder)
        self._key: SigningKey | None = None
        self._stamp: tuple[int, int] | None = None

    @property
    def path(self) -> Path:
        """The file of the private key."""
        return self.folder / "key.pem"

    @property
    def there(self) -> bool:
        """Whether there is a private key."""
        return self.path.is_file()

    def public(self) -> str | None:
        """The public key: that of key.pem where it can be read without a passphrase, else that of public.pem, or None.

        A key.pem that is no private key, or a public.pem of another key, raises KeyFaultError.
        """
        stated = self._stated()
        try:
            own = self._own(ask=False) if self.there else None
        except NoPrivateKeyError:
            raise
        except (FileError, LedgerError):  # see `uncompared`
            own = None
        return stated if own is None else self._compared(own, stated).public

    def uncompared(self) -> Finding | None:
        """Why public.pem is not compared with key.pem; None where it is, and where there is no key.pem."""
        try:
            if self.there:
                self._own(ask=False)
        except (FileError, LedgerError) as error:
            why = error.finding
            return Finding("key-uncompared", {"finding": why})
        return None

    def _compared(self, own: SigningKey, stated: str | None) -> SigningKey:
        """The key of key.pem; KeyFaultError where public.pem states another."""
        if stated in (None, own.public):
            return own
        raise OtherKeyError(self.folder / "public.pem", str(stated), own.public)

    def _stated(self) -> str | None:
        """What public.pem holds; None where it is missing."""
        path = self.folder / "public.pem"
        if not path.exists():
            return None
        try:
            return read_public(path).keys[0]
        except NoPublicKeyError:
            raise FileError(Finding("key-damaged", {"file": path.name}), path=path) from None

    def former(self, now: str | None = None) -> list[str]:
        """The public keys that were rotated into one, by default that of `public`, the newest first."""
        found: list[str] = []
        wanted = now or self.public()
        for one in reversed(self.changes()):
            if one["after"] == wanted and one["action"] == "rotated" and one["key"] == one["before"]:
                wanted = str(one["before"])
                found.append(wanted)
        return found

    def signing(self) -> SigningKey:
        """The private key.

        Raises LedgerError: none is there, or it cannot be read; a passphrase is missing or wrong; public.pem holds
        another key.
        """
        own = self._own(ask=True)
        try:
            stated = self._stated()
        except FileError:  # it follows from the private key: `make` writes it again
            stated = None
        return self._compared(own, stated)

    def _own(self, *, ask: bool) -> SigningKey:
        """The key of key.pem; `ask` for a passphrase where it can be typed."""
        try:
            found = self.path.stat()
            if self._key is None or self._stamp != (found.st_mtime_ns, found.st_ino):
                self._key = SigningKey(_private(whole(self.path, LARGEST_KEY), self.path, ask=ask))
                self._stamp = (found.st_mtime_ns, found.st_ino)
        except FileNotFoundError:
            raise LedgerError(Finding("key-none", {"folder": str(self.folder)})) from None
        except OSError as error:
            raise LedgerError(Finding("key-file", {"file": str(self.path), "reason": system_reason(error)})) from None
        return self._key

    def make(self) -> SigningKey:
        """The private key, made where there is none; of two that make one at once, the first one's stays."""
        if not self.there:
            self.keep("key.pem", private_pem(Ed25519PrivateKey.generate()), mode=0o600, replace=False)
        found = self.signing()
        try:
            missing = self._stated() is None
        except FileError:  # what it holds follows from the private key
            missing = True
        if missing:
            self.keep("public.pem", public_pem(found.public), mode=0o644)
        return found

    def rotate(self, reason: str) -> SigningKey:
        """A new key in the place of the old one, which signs for it."""
        if not stated(reason):
            raise refused("ledger-reason")
        return self._change("rotated", self.signing(), reason)

    def begin_anew(self, reason: str) -> SigningKey:
        """A new key where the old one is lost: nothing signs for it but itself, and every ledger will say so."""
        if not stated(reason):
            raise refused("ledger-reason")
        return self._change("lost", None, reason)

    def _change(self, action: str, old: SigningKey | None, reason: str) -> SigningKey:
        new = SigningKey(Ed25519PrivateKey.generate())
        try:
            before = self.public() if old is None else old.public
        except FileError:  # lost, too
            before = None
        time = datetime.now(UTC).isoformat(timespec="seconds")
        content = {"schema": CHANGE, "version": 1, "action": action, "before": before or "", "after": new.public}
        content |= {"reason": reason.strip(), "time": time}
        changes = [*self.changes(), (old or new).statement(content)]
        text = "".join(compact(one) + "\n" for one in changes)
        # the change first: a key whose predecessor's signature is lost could not be explained any more
        self.keep("changes.jsonl", text.encode(), mode=0o644)
        # at no moment beside a key.pem that it does not belong to
        (self.folder / "public.pem").unlink(missing_ok=True)
        self.keep("key.pem", private_pem(new.private), mode=0o600)
        self.keep("public.pem", public_pem(new.public), mode=0o644)
        (self.folder / "document.pem").unlink(missing_ok=True)
        return self.signing()

    def set_passphrase(self, passphrase: str) -> None:
        """Encrypt the key again; an empty passphrase leaves it plain."""
        key = self.signing()
        os.environ[PASSPHRASE] = passphrase
        self.keep("key.pem", private_pem(key.private), mode=0o600)
        (self.folder / "document.pem").unlink(missing_ok=True)

    def changes(self) -> list[dict[str, Any]]:
        """The statements made when keys were rotated or lost, oldest first; FileError for a line that is none."""
        found = []
        for line, row in self._statements("changes.jsonl", CHANGE):
            if row is None:
                path = self.folder / "changes.jsonl"
                raise FileError(Finding("key-damaged", {"file": path.name}), path=path, line=line)
            found.append(row)
        return found

    def breaks(self, ledger: str) -> list[dict[str, Any]]:
        """Who accepted a break of a ledger here, when and why, oldest first; a restored copy may not hold it."""
        names = {"author", "created", "reason", "before", "after"}
        rows = [row for _, row in self._statements("accepted.jsonl", BREAK) if row is not None]
        return [{n: row[n] for n in names} for row in rows if row.get("ledger") == ledger and names <= row.keys()]

    def _statements(self, name: str, schema: str) -> Iterator[tuple[int, dict[str, Any] | None]]:
        """Lines of a file and the statements in them, None where a line is none that a key signed."""
        path = self.folder / name
        try:
            there = path.exists()
        except OSError as error:
            raise FileError(Finding("file-unreadable", {"reason": system_reason(error)}), path=path) from None
        for number, line in enumerate(whole(path, LARGEST_SETTINGS).splitlines() if there else (), 1):
            if not line.strip():
                continue
            try:
                row = json.loads(line)
            except (ValueError, RecursionError):
                row = None
            fits = isinstance(row, dict) and row.get("schema") == schema and genuine(row)
            yield number, row if fits else None

    def keep_break(self, ledger: str, accepted: Mapping[str, Any]) -> None:
        """Keep what `breaks` gives, signed."""
        path = self.folder / "accepted.jsonl"
        before = whole(path, LARGEST_SETTINGS) if path.exists() else b""
        row = self.signing().statement({"schema": BREAK, "version": 1, "ledger": ledger, **accepted})
        self.keep(path.name, before + compact(row).encode() + b"\n", mode=0o644)

    def keep(self, name: str, data: bytes, *, mode: int, replace: bool = True) -> None:
        """A file, whole or not at all; one that must not be replaced is linked, which fails where it is there."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            handle, made = tempfile.mkstemp(dir=self.folder, prefix=f".{name}.")  # mode 0600 from the start
            try:
                with os.fdopen(handle, "wb") as stream:
                    stream.write(data)
                    stream.flush()
                    os.fsync(stream.fileno())
                Path(made).chmod(mode)
                if replace:
                    Path(made).replace(self.folder / name)
                else:
                    (self.folder / name).hardlink_to(made)
            except FileExistsError:
                pass
            finally:
                Path(made).unlink(missing_ok=True)
        except OSError as error:
            raise LedgerError(
                Finding("key-file", {"file": str(self.folder / name), "reason": system_reason(error)})
            ) from None


def _passphrase() -> bytes | None:
    return os.environ.get(PASSPHRASE, "").encode() or None


def private_pem(private: Any) -> bytes:
    """A private key as PKCS 8, encrypted where a passphrase is set."""
    phrase = _passphrase()
    cover: Any = serialization.NoEncryption() if phrase is None else serialization.BestAvailableEncryption(phrase)
    data: bytes = private.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, cover)
    return data


def load_private(data: bytes, path: Path, *, ask: bool = True) -> Any:
    """A private key of any kind from PEM; a missing passphrase is asked for where it can be typed, unless not to `ask`.

    Raises LedgerError: not a key; encrypted, and the passphrase is missing or wrong.
    """
    phrase = _passphrase()
    if b"ENCRYPTED" in data and phrase is None:
        if not ask or not sys.stdin or not sys.stdin.isatty():
            raise LedgerError(Finding("key-passphrase", {"file": str(path)}))
        phrase = getpass.getpass(f"passphrase of {path}: ").encode()
        os.environ[PASSPHRASE] = phrase.decode()
    try:
        return load_pem_private_key(data, phrase if b"ENCRYPTED" in data else None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        if b"ENCRYPTED" in data:
            raise LedgerError(Finding("key-passphrase", {"file": str(path)})) from None
        raise NoPrivateKeyError(Finding("key-damaged", {"file": str(path)})) from None


def _private(data: bytes, path: Path, *, ask: bool) -> Ed25519PrivateKey:
    found = load_private(data, path, ask=ask)
    if not isinstance(found, Ed25519PrivateKey):
        raise NoPrivateKeyError(Finding("key-damaged", {"file": str(path)}))
    return found


def public_pem(public: str) -> bytes:
    """A public key of 64 hexadecimal digits as PEM."""
    key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(public))
    return key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)


class NoPublicKeyError(FileError):
    """A file that holds no public key of a laboratory."""


class Public(NamedTuple):
    """What a laboratory publishes: its keys, the one of now first, and certificates that others made out for it."""

    keys: tuple[str, ...]
    certificates: tuple[Any, ...]


def read_public(path: str | Path) -> Public:
    """Public keys (64 hexadecimal digits) and X.509 certificates of a PEM file, as `ledger key --public` writes it."""
    data = whole(path, LARGEST_KEY)
    try:
        blocks = re.findall(rb"-----BEGIN PUBLIC KEY-----.*?-----END PUBLIC KEY-----", data, re.DOTALL)
        found = [load_pem_public_key(block) for block in blocks]
        certificates = x509.load_pem_x509_certificates(data) if b"BEGIN CERTIFICATE" in data else []
    except (ValueError, UnsupportedAlgorithm, x509.InvalidVersion):
        found, certificates = [], []
    keys = tuple(key.public_bytes_raw().hex() for key in found if isinstance(key, Ed25519PublicKey))
    if not keys:
        if b"PRIVATE KEY" in data:
            raise NoPublicKeyError(Finding("key-secret"), path=path)
        about = {"expected": "public key", "command": "inclinometry ledger key --public FILE"}
        raise NoPublicKeyError(Finding("ledger-other-file", about), path=path)
    return Public(keys, tuple(certificates))


def descends(public: str, trusted: str, changes: Iterable[Mapping[str, Any]]) -> bool:
    """Whether a key is the trusted one, or came from it by rotations, each signed by the key before."""
    known = {trusted}
    for one in changes:
        if one.get("action") == "rotated" and one.get("key") == one.get("before") in known and genuine(one):
            known.add(str(one.get("after")))
    return public in known


def explained(before: str, after: str, changes: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]] | None:
    """The changes that lead from one key to another, oldest first; None where none do.

    A key begun where nothing was left of the one before names none, and stands for any. The key before signs for the
    one that it is rotated into, a new one for itself where the other is lost: what others say of them does not count.
    """
    signer = {"rotated": "before", "lost": "after"}
    said = [one for one in changes if one.get("key") == one.get(signer.get(str(one.get("action")), ""), "")]
    path: list[Mapping[str, Any]] = []
    wanted = after
    while wanted != before:
        found = next((one for one in reversed(said) if one.get("after") == wanted), None)
        if found is None or found in path:
            return None
        path.append(found)
        wanted = str(found.get("before")) or before
    return path[::-1]
