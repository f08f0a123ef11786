"""A certificate signed: the seal of its record, the PDF (PAdES), the digital certificate (XAdES); and looked at again.

The laboratory's Ed25519 key signs the seal: number and digest of the record, in the JSON file and in the square code.
PDF and XML are signed by a document key, ECDSA P-256, which every reader of these formats knows; its X.509 certificate
is made out by the laboratory's key, so that one public key proves all of it. A key and certificate of an authority, put
into document.pem, take its place.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from threading import Thread
from typing import Any, Final, NamedTuple, TypeAlias

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509 import Certificate

from inclinometry.errors import FileError, InputError
from inclinometry.files.json_codec import canonical, parse
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.record import record_digest
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.keys import (
    LARGEST_KEY,
    Keys,
    Public,
    fingerprint,
    load_private,
    private_pem,
    public_pem,
    right,
)
from inclinometry.opening import whole

SIGNATURE: Final = "signature"
"""Key of the JSON file that is not of the record: its seal, and the public key."""
_SEAL: Final = re.compile(
    r"inclinometry certificate (?P<number>.{1,200}?) (?P<digest>sha256:[0-9a-f]{64})"
    r"(?: (?P<key>[0-9a-f]{32}) (?P<signature>[A-Za-z0-9+/]{86}==))?"
)
_DS: Final = "http://www.w3.org/2000/09/xmldsig#"


class Seal(NamedTuple):
    """What the square code says: number and digest of the record, fingerprint of the key, its signature."""

    number: str
    digest: str
    key: str = ""
    signature: str = ""

    def __str__(self) -> str:
        return " ".join(filter(None, ("inclinometry certificate", *self)))

    def message(self) -> bytes:
        """What is signed."""
        return str(self._replace(signature="")).encode()


def seal(record: Mapping[str, Any], keys: Keys) -> Seal:
    """The seal of a record by the laboratory's key."""
    key = keys.signing()
    bare = Seal(record["number"], record_digest(record), fingerprint(key.public))
    return bare._replace(signature=key.sign(bare.message()))


def parse_seal(text: str) -> Seal | None:
    """The seal of a square code's text; None for other texts.

    >>> parse_seal("inclinometry certificate 2026-0001 sha256:" + 64 * "0").number
    '2026-0001'
    """
    found = _SEAL.fullmatch(" ".join(text.split()))
    return None if found is None else Seal(*(found[name] or "" for name in Seal._fields))


def sealed_by(made: Seal, public: Public) -> str:
    """The public key that signed a seal; "" when none of these did."""
    signed = (one for one in public.keys if fingerprint(one) == made.key and right(one, made.signature, made.message()))
    return next(signed, "")


# The document key and its certificates.


DocumentKey: TypeAlias = "tuple[Any, tuple[Certificate, ...]]"
"""What signs PDF and XML: a private key of ECDSA or RSA, its X.509 certificate first, those above it behind."""


def document_key(keys: Keys, name: str) -> DocumentKey:
    """The document key of a laboratory of that name; made, and certified by its key, where there is none.

    Raises LedgerError: no laboratory's key; document.pem holds no key with a certificate for it.
    """
    path = keys.folder / "document.pem"
    name = name[:64] or "laboratory"  # the longest common name of X.509
    public = Public((keys.signing().public,), ())
    if path.is_file():
        data = whole(path, LARGEST_KEY)
        private = load_private(data, path)
        try:
            found = tuple(x509.load_pem_x509_certificates(data))
        except ValueError:
            found = ()
        if not found or found[0].public_key() != private.public_key():
            raise LedgerError(Finding("key-document", {"file": str(path)}))
        if not _one_path(found[0], found):
            raise LedgerError(Finding("key-document", {"file": str(path)}))
        stated = found[0].subject.rfc4514_string() == _name(name).rfc4514_string()
        if stated or not made_out_by(found[0], public):  # of an authority: as it is
            return private, found
    private, made = _new_document_key(keys, name)
    pem = b"".join(one.public_bytes(Encoding.PEM) for one in made)
    keys.keep("document.pem", private_pem(private) + pem, mode=0o600)
    return private, made


def _name(text: str) -> Any:
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)])


def _new_document_key(keys: Keys, name: str) -> DocumentKey:
    issuer, private = keys.signing(), ec.generate_private_key(ec.SECP256R1())
    own = issuer.private.public_key()
    of_laboratory = _name(f"inclinometry laboratory {fingerprint(issuer.public)}")
    # no end that is known (RFC 5280, 4.1.2.5): a key ends when it is rotated
    first, last = datetime.now(UTC) - timedelta(days=1), datetime(9999, 12, 31, 23, 59, 59, tzinfo=UTC)

    def certificate(subject: Any, key: Any, authority: bool) -> Certificate:
        unused = ("key_encipherment", "data_encipherment", "key_agreement", "encipher_only", "decipher_only")
        usage = dict.fromkeys(unused, False)
        usage |= dict.fromkeys(("digital_signature", "content_commitment"), not authority)
        usage |= dict.fromkeys(("key_cert_sign", "crl_sign"), authority)
        builder = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(of_laboratory)
            .public_key(key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(first)
            .not_valid_after(last)
            .add_extension(x509.BasicConstraints(ca=authority, path_length=0 if authority else None), critical=True)
            .add_extension(x509.KeyUsage(**usage), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(own), critical=False)
        )
        return builder.sign(issuer.private, None)

    leaf = certificate(_name(name), private.public_key(), False)
    return private, (leaf, certificate(of_laboratory, own, True))


def made_out_by(certificate: Certificate, public: Public) -> str:
    """Fingerprint of the laboratory's key that made out a certificate, or of one that it published; "" for others."""
    if certificate in public.certificates:
        return certificate.fingerprint(hashes.SHA256()).hex()[:32]
    for one in public.keys:
        try:
            key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(one))
            key.verify(certificate.signature, certificate.tbs_certificate_bytes)
        except InvalidSignature:
            continue
        return fingerprint(one)
    return ""


def public_bundle(keys: Keys) -> bytes:
    """What the laboratory publishes, PEM: its key, those that were rotated into it, an authority's certificate.

    Raises LedgerError: the private key is here and cannot be read; public.pem holds another key.
    """
    known = _published(keys)
    return b"".join([*map(public_pem, known), *(one.public_bytes(Encoding.PEM) for one in of_authority(keys))])


def _published(keys: Keys) -> tuple[str, ...]:
    # nothing is published that was not compared with the private key where that is here
    now = keys.signing().public if keys.there else keys.public()
    return (*([now] if now else []), *keys.former(now))


def of_authority(keys: Keys) -> list[Certificate]:
    """The certificate in document.pem, where the laboratory's key did not make it; none otherwise."""
    path = keys.folder / "document.pem"
    found = x509.load_pem_x509_certificates(whole(path, LARGEST_KEY)) if path.is_file() else []
    return [one for one in found[:1] if not made_out_by(one, Public(_published(keys), ()))]


# Signing.


def sign_json(record: Mapping[str, Any], made: Seal, public: str) -> bytes:
    """The JSON file: the record with its seal."""
    return canonical({**record, SIGNATURE: {"seal": str(made), "key": public}})


def sign_pdf(data: bytes, key: DocumentKey, made: Seal, name: str) -> bytes:
    """The PDF with a PAdES signature (B-B) that allows no change; what was there stays as it was, byte for byte."""

    def signed() -> bytes:
        from asn1crypto import keys as asn1_keys
        from asn1crypto import x509 as asn1_x509
        from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
        from pyhanko.sign import fields, signers
        from pyhanko_certvalidator.registry import SimpleCertificateStore

        der = serialization.Encoding.DER
        plain = (serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
        private, certificates = key
        chain = [asn1_x509.Certificate.load(one.public_bytes(der)) for one in certificates]
        store: Any = SimpleCertificateStore()  # type: ignore[no-untyped-call]
        store.register_multiple(chain)
        signer = signers.SimpleSigner(
            signing_cert=chain[0],
            signing_key=asn1_keys.PrivateKeyInfo.load(private.private_bytes(der, *plain)),
            cert_registry=store,
        )
        about = signers.PdfSignatureMetadata(
            field_name="LaboratorySignature",
            md_algorithm="sha256",
            subfilter=fields.SigSeedSubFilter.PADES,
            name=name,
            reason=str(Seal(made.number, made.digest)),
            certify=True,
            docmdp_permissions=fields.MDPPerm.NO_CHANGES,
        )

        class Archived(signers.PdfSigner):
            def register_extensions(self, pdf_out: Any, **_: Any) -> None:
                """None: they would make a PDF 2.0 of it, and PDF/A-2 is 1.7."""

        class Kept(IncrementalPdfFileWriter):
            def _update_meta(self) -> None:
                """The metadata as they were: written again they lose the prefixes that PDF/A asks for."""

        writer = Kept(io.BytesIO(data))
        # hexadecimal digits for the signature: certificates of an authority fit, too
        out = Archived(about, signer=signer).sign_pdf(writer, bytes_reserved=24_000, output=io.BytesIO())
        return bytes(out.getvalue())

    made_pdf: bytes = _run_outside_event_loop(signed)
    return made_pdf


def sign_dcc(data: bytes, key: DocumentKey) -> bytes:
    """The digital certificate with an enveloped XAdES signature, as its schema allows at its end."""
    from lxml import etree
    from signxml.algorithms import DigestAlgorithm, SignatureMethod
    from signxml.xades.xades import XAdESSigner

    private, certificates = key
    rsa = isinstance(private, RSAPrivateKey)
    signer = XAdESSigner(
        signature_algorithm=SignatureMethod.RSA_SHA256 if rsa else SignatureMethod.ECDSA_SHA256,
        digest_algorithm=DigestAlgorithm.SHA256,
    )
    root = signer.sign(etree.fromstring(data), key=private, cert=list(certificates))
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8")


def sign_files(
    record: Mapping[str, Any], pdf: bytes | None, dcc: bytes | None, made: Seal, keys: Keys
) -> tuple[bytes | None, bytes | None, bytes]:
    """PDF, DCC and JSON file of a certificate, signed; `pdf` bears the seal in its square code already."""
    name = str((record["laboratory"] or {}).get("name", ""))
    key = document_key(keys, name)
    return (
        None if pdf is None else sign_pdf(pdf, key, made, name or "laboratory"),
        None if dcc is None else sign_dcc(dcc, key),
        sign_json(record, made, keys.signing().public),
    )


def unsigned(content: Mapping[str, Any]) -> dict[str, Any]:
    """The record of a JSON file."""
    return {name: value for name, value in content.items() if name != SIGNATURE}


def _run_outside_event_loop(work: Callable[[], Any]) -> Any:
    """The result of work that brings an event loop of its own, which may not run inside that of a server."""
    found: list[Any] = []
    failed: list[BaseException] = []

    def run() -> None:
        try:
            found.append(work())
        except BaseException as error:
            failed.append(error)

    thread = Thread(target=run)
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return found[0]


# Looking at a signed file, with nothing but the laboratory's public key.


_UNSIGNED: Final = Finding("certificate-unsigned")
_CHANGED: Final = Finding("certificate-changed")


class Looked(NamedTuple):
    """What a file proves.

    kind : "PDF", "DCC", "JSON" or "square code". number, digest : "" where it cannot be told.
    problem : why it is not genuine; None when it is. key : fingerprint of the key that stands behind it.
    signer : who signed it, where that is none of the keys given: then nothing is proven and nothing disproven.
    """

    kind: str
    number: str
    digest: str
    problem: Finding | None
    key: str = ""
    record: dict[str, Any] | None = None
    signer: Public | None = None


def look(data: bytes, where: str, public: Public) -> Looked:
    """Whether the laboratory signed a file as it is.

    Raises FileError: neither PDF, digital certificate nor record.
    """
    found = _look(data, where, public)
    if found.signer is None or found.kind == "square code":
        return found
    own = _look(data, where, found.signer)
    return own if own.problem else found  # a broken signature is no one's


def _look(data: bytes, where: str, public: Public) -> Looked:
    head = data.lstrip()[:5]
    if data.startswith(b"%PDF"):
        return _run_outside_event_loop(lambda: _look_at_pdf(data, public))  # type: ignore[no-any-return]
    if head.startswith(b"<"):
        return _look_at_dcc(data, where, public)
    if head.startswith(b"{"):
        return _look_at_json(data, where, public)
    text = data[:1000].decode("utf-8", errors="replace")
    made = parse_seal(text) if len(data) < 1000 else None
    if made is None:
        raise FileError(Finding("certificate-not-one"), path=where)
    return look_at_seal(made, public)


def look_at_seal(made: Seal, public: Public) -> Looked:
    """Whether the text of a square code is one that the laboratory signed."""
    if not made.signature:
        return Looked("square code", made.number, made.digest, _UNSIGNED)
    key = sealed_by(made, public)
    seen = Looked("square code", made.number, made.digest, None, made.key)
    if key:
        return seen
    if made.key in map(fingerprint, public.keys):
        return seen._replace(problem=_forged(made))
    return seen._replace(problem=Finding("certificate-key", {"key": made.key}), signer=Public((), ()))


def _forged(made: Seal) -> Finding:
    return Finding("key-forged", {"place": made.number, "key": made.key})


def _look_at_json(data: bytes, where: str, public: Public) -> Looked:
    try:
        content = parse(data)
        about = content.get(SIGNATURE, {})
        record = unsigned(content)
        number, digest = str(record["number"]), record_digest(record)
        made = parse_seal(about["seal"]) if about else None
        spelled = canonical(content)
    except (InputError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise FileError(Finding("certificate-not-one"), path=where) from None
    if made is None:
        return Looked("JSON", number, digest, _UNSIGNED, record=record)
    same = about == {"seal": str(made), "key": about.get("key")}
    if (made.number, made.digest) != (number, digest) or spelled != data or not same:
        return Looked("JSON", number, digest, _CHANGED, made.key, record)
    seen, key = Looked("JSON", number, digest, None, made.key, record), str(about["key"])
    if key == sealed_by(made, public) != "":
        return seen
    its_own = re.fullmatch("[0-9a-f]{64}", key) is not None and fingerprint(key) == made.key
    if made.key in map(fingerprint, public.keys) or not its_own:
        return seen._replace(problem=_forged(made))
    return seen._replace(problem=Finding("certificate-key", {"key": made.key}), signer=Public((key,), ()))


def _look_at_dcc(data: bytes, where: str, public: Public) -> Looked:
    from lxml import etree
    from signxml.exceptions import InvalidCertificate, InvalidDigest, InvalidInput, InvalidSignature
    from signxml.verifier import SignatureConfiguration
    from signxml.xades.xades import XAdESSignatureConfiguration, XAdESVerifier

    from inclinometry.laboratory.certificate.dcc import dcc_root, read_dcc

    root = dcc_root(data, where)
    seen = Looked("DCC", "", "", _unsigned_content(root))
    with suppress(FileError):  # only to name it: what it proves is read from what was signed
        said = read_dcc(data, where)
        seen = seen._replace(number=said.number, digest=said.digest)
    if seen.problem:
        return seen
    try:
        leaf = _certificate(root.xpath("string((./*/*/*/*[local-name()='X509Certificate'])[1])"))
    except (ValueError, x509.InvalidVersion):
        return seen._replace(problem=_CHANGED)
    key = made_out_by(leaf, public)
    if not key:
        others = root.xpath("./*[local-name()='Signature']//*[local-name()='X509Certificate']/text()")
        return _by_others(seen, leaf, (_certificate(text) for text in others), public)
    here: SignatureConfiguration = XAdESSignatureConfiguration(location="./", require_x509=True)
    try:
        found = XAdESVerifier().verify(data, x509_cert=leaf, expect_config=here)
    except (
        InvalidSignature, InvalidDigest, InvalidCertificate, InvalidInput, UnsupportedAlgorithm, ValueError, TypeError,
        etree.LxmlError,
    ):  # fmt: skip
        return seen._replace(problem=_CHANGED, key=key)
    said = read_dcc(found[0].signed_data, where)
    return seen._replace(number=said.number, digest=said.digest, key=key)


def _unsigned_content(root: Any) -> Finding | None:
    """What stands in a digital certificate that its signature does not cover, or may not; None when nothing does.

    An enveloped signature is over the document without itself, over its key and its properties: any other content of
    it would be no one's (signature wrapping).
    """
    from lxml.etree import QName

    from inclinometry.laboratory.certificate.dcc import ROOT

    # XAdES signs without comments, and they cut a value in two: a reader sees another one than was signed
    if root.getroottree().xpath("//comment() | //processing-instruction()"):
        return _CHANGED
    if len([*root.iter(ROOT)]) != 1:
        return _CHANGED
    signatures = root.xpath("//*[local-name()='Signature']")
    if not signatures:
        return _UNSIGNED
    one, xades = signatures[0], "http://uri.etsi.org/01903/v1.3.2#"
    parts = [f"{{{_DS}}}{name}" for name in ("SignedInfo", "SignatureValue", "KeyInfo", "Object")]
    if len(signatures) != 1 or one is not root[-1] or QName(one).namespace != _DS or [e.tag for e in one] != parts:
        return _CHANGED
    info, value, key, holder = one
    around = holder.find(f"{{{xades}}}QualifyingProperties")
    about = None if around is None else around.find(f"{{{xades}}}SignedProperties")
    if about is None or len(holder) != 1 or len(around) != 1 or len(value):
        return _CHANGED
    name = str(one.get("Id"))
    stated = [(one, {"Id": name}), (value, {}), (holder, {}), (around, {"Target": f"#{name}"})]
    between = [around.text, about.tail, holder.text, around.tail, one.text, *(part.tail for part in one)]
    letters = "".join((value.text or "").split())
    try:
        spelled = base64.b64encode(base64.b64decode(letters, validate=True)).decode() == letters
    except ValueError:
        spelled = False
    if not spelled or any(dict(part.attrib) != wanted for part, wanted in stated):
        return _CHANGED
    if any((text or "").strip() for text in between):
        return _CHANGED
    return None if _references(info) == [("", True), *((f"#{e.get('Id')}", False) for e in (about, key))] else _CHANGED


def _references(info: Any) -> list[tuple[str, bool]]:
    """What a signature says that it is over, and whether without itself; in no other form than it was signed."""
    found = []
    for one in info.iterfind(f"{{{_DS}}}Reference"):
        made = [str(step.get("Algorithm")) for step in one.iterfind(f"{{{_DS}}}Transforms/{{{_DS}}}Transform")]
        whole = made[:1] == [f"{_DS}enveloped-signature"] and len(made) == 2 and "c14n" in made[1]
        found.append((str(one.get("URI")), whole))
        if made and not whole:
            return []
    return found


def _certificate(text: str) -> Certificate:
    """The certificate of base64 in XML."""
    body = "".join(text.split())
    return x509.load_pem_x509_certificate(f"-----BEGIN CERTIFICATE-----\n{body}\n-----END CERTIFICATE-----\n".encode())


def _by_others(seen: Looked, leaf: Certificate, beside: Iterable[Certificate], public: Public) -> Looked:
    """What a document says whose key none of the given ones made out; `beside` are the certificates that lead on."""
    try:
        found = [one.public_key() for one in beside]
    except (ValueError, UnsupportedAlgorithm, x509.InvalidVersion):
        return seen._replace(problem=_CHANGED)
    keys = [one.public_bytes_raw().hex() for one in found if isinstance(one, Ed25519PublicKey)]
    own = next((one for one in keys if made_out_by(leaf, Public((one,), ()))), "")
    if own:
        by = fingerprint(own)
        return seen._replace(problem=Finding("certificate-key", {"key": by}), key=by, signer=Public((own,), ()))
    about = {"signer": f"{leaf.subject.rfc4514_string()!r:.100}", "key": fingerprint(public.keys[0])}
    return seen._replace(problem=Finding("certificate-signer", about), signer=Public((), (leaf,)))


def _look_at_pdf(data: bytes, public: Public) -> Looked:
    import logging

    from pyhanko.pdf_utils.misc import PdfError
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature
    from pyhanko.sign.validation.status import SignatureCoverageLevel
    from pyhanko_certvalidator import ValidationContext

    logging.getLogger("pyhanko").setLevel(logging.CRITICAL)  # what is wrong is a finding
    logging.getLogger("pyhanko_certvalidator").setLevel(logging.CRITICAL)
    seen = Looked("PDF", "", "", None)
    try:
        signatures = PdfFileReader(io.BytesIO(data)).embedded_signatures
        if not signatures:
            return seen._replace(problem=_UNSIGNED)
        one = signatures[0]
        made = parse_seal(str(one.sig_object.get("/Reason", "")))
        leaf = x509.load_der_x509_certificate(one.signer_cert.dump())
        if made is None:
            return seen._replace(problem=_UNSIGNED)
        seen = seen._replace(number=made.number, digest=made.digest)
        key = made_out_by(leaf, public)
        if not key:
            others = (x509.load_der_x509_certificate(each.dump()) for each in one.other_embedded_certs)
            return _by_others(seen, leaf, others, public)
        if not _as_we_sign(data, one, leaf):
            return seen._replace(problem=_CHANGED, key=key)
        context = ValidationContext(trust_roots=[one.signer_cert], allow_fetching=False)
        status = validate_pdf_signature(one, context)
        whole = status.coverage == SignatureCoverageLevel.ENTIRE_FILE and len(signatures) == 1
    except (
        PdfError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError, OSError,
        UnsupportedAlgorithm, x509.InvalidVersion,
    ):  # fmt: skip
        return seen._replace(problem=_CHANGED)
    if not (status.intact and status.valid and status.trusted and whole):
        return seen._replace(problem=_CHANGED, key=key)
    return seen._replace(key=key)


def _as_we_sign(data: bytes, one: Any, leaf: Certificate) -> bool:
    """Whether the room of a PDF's signature, which nothing signs, holds what we write there and nothing else.

    That is the CMS in hexadecimal digits, then zeros; in the CMS one signer, no unsigned attributes, no certificates
    but those that lead on from the signer's.
    """
    from asn1crypto import cms

    first, behind = int(one.byte_range[1]), int(one.byte_range[2])
    room, content = data[first:behind], bytes(one.pkcs7_content)
    made = cms.ContentInfo.load(content)
    der = made.dump()
    # one spelling only: what is read is what stands there, each length in its shortest form
    if room != b"<%s>" % content.hex().upper().encode() or content[len(der) :].strip(b"\0"):
        return False
    if cms.ContentInfo.load(der).dump(force=True) != der:
        return False
    signed, signers = made["content"], made["content"]["signer_infos"]
    if len(signers) != 1 or len(signed["digest_algorithms"]) != 1 or len(signed["crls"]):
        return False
    signer = signers[0]
    algorithms = (signed["digest_algorithms"][0], signer["digest_algorithm"], signer["signature_algorithm"])
    plain = all(algorithm["parameters"].native is None for algorithm in algorithms)
    # names are compared without regard to their letters' case elsewhere
    who, by = signer["sid"], one.signer_cert.issuer.dump()
    if who.name != "issuer_and_serial_number" or who.chosen["issuer"].dump() != by:
        return False
    if signed["digest_algorithms"][0].dump() != signer["digest_algorithm"].dump():
        return False
    version, about = (signed["version"].native, signer["version"].native), signed["encap_content_info"]
    if not plain or version != ("v1", "v1") or about.native != {"content_type": "data", "content": None}:
        return False
    if len(signer["unsigned_attrs"]) or any(each.name != "certificate" for each in signed["certificates"]):
        return False
    given = [each.chosen for each in signed["certificates"]]
    if any(each.serial_number <= 0 for each in given):  # not read without a warning
        return False
    return _one_path(leaf, [x509.load_der_x509_certificate(each.dump()) for each in given])


def _one_path(leaf: Certificate, given: Sequence[Certificate]) -> bool:
    """Whether certificates are one path: each made out by the next, the last by itself; or there is only the first."""

    def by(one: Certificate, issuer: Certificate) -> bool:
        try:
            one.verify_directly_issued_by(issuer)
        except (InvalidSignature, UnsupportedAlgorithm, ValueError, TypeError):
            return False
        return True

    rest = [one for one in dict.fromkeys(given) if one != leaf]
    last = leaf
    while rest:
        above = next((one for one in rest if by(last, one)), None)
        if above is None:
            return False
        rest.remove(above)
        last = above
    return last == leaf or by(last, last)
