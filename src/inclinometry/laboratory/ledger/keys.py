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
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from inclinometry.errors import FileError, InputError
from inclinometry.laboratory.ledger.chain import LedgerError, compact
from inclinometry.opening import LARGEST_SETTINGS, whole

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

FOLDER: Final = "INCLINOMETRY_KEYS"
"""Environment: the folder of the keys, in the place of the one in the user's configuration."""
PASSPHRASE: Final = "INCLINOMETRY_KEY_PASSPHRASE"
"""Environment: the passphrase of the keys; asked for on a terminal when not given."""
CHANGE: Final = "inclinometry/key-change"
LARGEST_KEY: Final = 1_000_000
"""Bytes of a file of keys, and of certificates."""
_PREFIX: Final = b"inclinometry signed statement\n"  # no signature of ours can serve another purpose


def default_folder() -> Path:
    """Where the keys are: in the user's configuration, or where INCLINOMETRY_KEYS says."""
    given = os.environ.get(FOLDER)
    if given:
        return Path(given)
    base = os.environ.get("APPDATA") if os.name == "nt" else os.environ.get("XDG_CONFIG_HOME")
    return Path(base or Path.home() / ".config") / "inclinometry" / "keys"


def fingerprint(public: str) -> str:
    """What people compare of a public key (64 hexadecimal digits): 32 digits of its SHA-256.

    Examples
    --------
    >>> fingerprint("00" * 32)
    '66687aadf862bd776c8fc18b8e9f8e20'
    """
    return hashlib.sha256(bytes.fromhex(public)).hexdigest()[:32]


def signed_bytes(statement: Mapping[str, Any]) -> bytes:
    """What the signature of a statement is over."""
    return _PREFIX + compact({name: value for name, value in statement.items() if name != "signature"}).encode()


def right(public: str, signature: str, message: bytes) -> bool:
    """Whether a signature, base64, over bytes is that of a public key, 64 hexadecimal digits."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

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


class SigningKey:
    """A private Ed25519 key.

    Parameters
    ----------
    private : Ed25519PrivateKey
    """

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
    """The folder of a laboratory's keys; read when they are needed.

    Parameters
    ----------
    folder : str or Path, optional
        `default_folder()` when not given.

    Notes
    -----
    key.pem is the private key (PKCS 8, mode 0600), public.pem its public one, changes.jsonl what was signed when it was
    rotated or lost, document.pem the key that signs documents with its X.509 certificates, heads/ the witness of this
    computer, witnesses.txt the other places that heads go to.
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
        """The public key, without asking for a passphrase; None where there is none.

        Raises
        ------
        FileError
            The file holds something else.
        """
        path = self.folder / "public.pem"
        if not path.exists():
            return None
        try:
            return read_public(path).keys[0]
        except NoPublicKeyError:
            raise FileError(
                "not a public key any more; `inclinometry ledger key --make` writes it anew from key.pem, or restore "
                "it from a copy",
                path=path,
            ) from None

    def former(self) -> list[str]:
        """The public keys that were rotated into the one of now, the newest first."""
        found: list[str] = []
        wanted = self.public()
        for one in reversed(self.changes()):
            if one["after"] == wanted and one["action"] == "rotated" and one["key"] == one["before"]:
                wanted = str(one["before"])
                found.append(wanted)
        return found

    def signing(self) -> SigningKey:
        """The private key.

        Raises
        ------
        LedgerError
            None is there, or it cannot be read; a passphrase is missing or wrong.
        """
        try:
            found = self.path.stat()
            if self._key is None or self._stamp != (found.st_mtime_ns, found.st_ino):
                self._key = SigningKey(_private(whole(self.path, LARGEST_KEY), self.path))
                self._stamp = (found.st_mtime_ns, found.st_ino)
        except FileNotFoundError:
            raise LedgerError(
                f"there is no key in {self.folder}; make one with `inclinometry ledger key --make`"
            ) from None
        except OSError as error:
            raise LedgerError(f"{self.path} cannot be read ({error.strerror}); check its permissions") from None
        return self._key

    def make(self) -> SigningKey:
        """The private key, made where there is none; of two that make one at once, the first one's stays."""
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

        if not self.there:
            self._write_new(Ed25519PrivateKey.generate(), replace=False)
        found = self.signing()
        try:
            stated = self.public()
        except FileError:  # what it holds follows from the private key
            stated = None
        if stated != found.public:
            self.keep("public.pem", _public_pem(found.private), mode=0o644)
        return found

    def rotate(self, reason: str) -> SigningKey:
        """A new key in the place of the old one, which signs for it."""
        if not reason.strip():
            raise InputError("say why the key is rotated: a new one is not begun without a reason")
        return self._change("rotated", self.signing(), reason)

    def begin_anew(self, reason: str) -> SigningKey:
        """A new key where the old one is lost: nothing signs for it but itself, and every ledger will say so."""
        if not reason.strip():
            raise InputError("say how the key was lost: a new one is not begun without a reason")
        return self._change("lost", None, reason)

    def _change(self, action: str, old: SigningKey | None, reason: str) -> SigningKey:
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

        new = SigningKey(Ed25519PrivateKey.generate())
        try:
            before = self.public() if old is None else old.public
        except FileError:  # lost, too
            before = None
        content = {
            "schema": CHANGE,
            "version": 1,
            "action": action,
            "before": before or "",
            "after": new.public,
            "reason": reason.strip(),
            "time": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        changes = [*self.changes(), (old or new).statement(content)]
        text = "".join(compact(one) + "\n" for one in changes)
        # the change first: a key whose predecessor's signature is lost could not be explained any more
        self.keep("changes.jsonl", text.encode(), mode=0o644)
        self._write_new(new.private, replace=True)
        self.keep("public.pem", _public_pem(new.private), mode=0o644)
        (self.folder / "document.pem").unlink(missing_ok=True)
        return self.signing()

    def set_passphrase(self, passphrase: str) -> None:
        """Encrypt the key anew; an empty passphrase leaves it plain."""
        key = self.signing()
        os.environ[PASSPHRASE] = passphrase
        self._write_new(key.private, replace=True)
        (self.folder / "document.pem").unlink(missing_ok=True)

    def changes(self) -> list[dict[str, Any]]:
        """The statements made when keys were rotated or lost, oldest first.

        Raises
        ------
        FileError
            It cannot be read, or a line is none of them.
        """
        path = self.folder / "changes.jsonl"
        try:
            there = path.exists()
        except OSError as error:
            raise FileError(f"cannot be read ({error.strerror}); check its permissions", path=path) from None
        if not there:
            return []
        found = []
        for number, line in enumerate(whole(path, LARGEST_SETTINGS).splitlines(), 1):
            try:
                row = json.loads(line) if line.strip() else None
            except (ValueError, RecursionError):
                row = ""
            if isinstance(row, dict) and row.get("schema") == CHANGE and genuine(row):
                found.append(row)
            elif row is not None:
                raise FileError(
                    "not what a laboratory's key signed when it was rotated or lost; restore the file from a copy, or "
                    "take the line out: every ledger has recorded the changes that it knows of",
                    path=path,
                    line=number,
                )
        return found

    def _write_new(self, private: Any, *, replace: bool) -> None:
        self.keep("key.pem", private_pem(private), mode=0o600, replace=replace)

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
                f"the keys cannot be kept in {self.folder} ({error.strerror}); name another folder by {FOLDER}"
            ) from None


def _passphrase() -> bytes | None:
    given = os.environ.get(PASSPHRASE)
    return given.encode() if given else None


def private_pem(private: Any) -> bytes:
    """A private key as PKCS 8, encrypted where a passphrase is set."""
    from cryptography.hazmat.primitives import serialization

    phrase = _passphrase()
    cover: Any = serialization.NoEncryption() if phrase is None else serialization.BestAvailableEncryption(phrase)
    data: bytes = private.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, cover)
    return data


def load_private(data: bytes, path: Path) -> Any:
    """A private key of any kind from PEM.

    Raises
    ------
    LedgerError
        Not a key; encrypted, and the passphrase is missing or wrong.
    """
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    phrase = _passphrase()
    if b"ENCRYPTED" in data and phrase is None:
        if not sys.stdin or not sys.stdin.isatty():
            raise LedgerError(f"{path} is encrypted; put its passphrase into the environment as {PASSPHRASE}")
        phrase = getpass.getpass(f"passphrase of {path}: ").encode()
        os.environ[PASSPHRASE] = phrase.decode()
    try:
        return load_pem_private_key(data, phrase if b"ENCRYPTED" in data else None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        remedy = "or its passphrase is wrong" if b"ENCRYPTED" in data else "restore it from a copy"
        raise LedgerError(f"{path} is not a private key; {remedy}") from None


def _private(data: bytes, path: Path) -> Ed25519PrivateKey:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    found = load_private(data, path)
    if not isinstance(found, Ed25519PrivateKey):
        raise LedgerError(f"{path} is a key of another kind; the key of a laboratory is an Ed25519 key")
    return found


def _public_pem(private: Ed25519PrivateKey) -> bytes:
    return public_pem(private.public_key().public_bytes_raw().hex())


def public_pem(public: str) -> bytes:
    """A public key of 64 hexadecimal digits as PEM."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

    key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(public))
    return key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)


class NoPublicKeyError(FileError):
    """A file that holds no public key of a laboratory."""


class Public(NamedTuple):
    """What a laboratory publishes: its keys, the one of now first, and certificates that others made out for it."""

    keys: tuple[str, ...]
    certificates: tuple[Any, ...]


def read_public(path: str | Path) -> Public:
    """Public keys (64 hexadecimal digits) and X.509 certificates of a PEM file, as `ledger key --public` writes it.

    Raises
    ------
    NoPublicKeyError
        No Ed25519 public key is in it.
    FileError
        No such file, or too large a one.
    """
    from cryptography import x509
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    data = whole(path, LARGEST_KEY)
    try:
        blocks = re.findall(rb"-----BEGIN PUBLIC KEY-----.*?-----END PUBLIC KEY-----", data, re.DOTALL)
        found = [load_pem_public_key(block) for block in blocks]
        certificates = x509.load_pem_x509_certificates(data) if b"BEGIN CERTIFICATE" in data else []
    except (ValueError, UnsupportedAlgorithm, x509.InvalidVersion):
        found, certificates = [], []
    keys = tuple(key.public_bytes_raw().hex() for key in found if isinstance(key, Ed25519PublicKey))
    if not keys:
        secret = b"PRIVATE KEY" in data
        remedy = "this is a private key: give nobody this file, but what `inclinometry ledger key --public FILE` writes"
        problem = "not the public key of a laboratory; the file that `inclinometry ledger key --public FILE` writes"
        raise NoPublicKeyError(remedy if secret else problem, path=path)
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
