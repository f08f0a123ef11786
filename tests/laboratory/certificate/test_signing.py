"""A certificate proven by the laboratory's public key alone, file by file; one byte changed is one too many."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from lxml import etree
from tests.refusals import refused

from inclinometry.digest import digest_bytes
from inclinometry.errors import FileError
from inclinometry.files.json_codec import canonical
from inclinometry.findings import Finding
from inclinometry.laboratory.certificate.dcc import dcc_bytes, read_dcc
from inclinometry.laboratory.certificate.pdf import certificate_pdf
from inclinometry.laboratory.certificate.record import record_bytes, record_digest
from inclinometry.laboratory.certificate.signing import look, parse_seal, public_bundle, seal, sign_files, unsigned
from inclinometry.laboratory.ledger.chain import LedgerError
from inclinometry.laboratory.ledger.keys import Keys, Public, fingerprint, read_public

from .certificates import dcc_schema, record

CHANGED = Finding("certificate-changed")


class Laboratory:
    """Keys, the files of one certificate, what is published."""

    def __init__(self, folder: Path) -> None:
        self.keys = Keys(folder)
        self.keys.make()
        self.record = record()
        self.seal = seal(self.record, self.keys)
        self.plain = certificate_pdf(self.record, seal=str(self.seal))
        self.files = sign_files(self.record, self.plain, dcc_bytes(self.record), self.seal, self.keys)
        self.pdf, self.dcc, self.json = self.files
        self.bundle = folder / "laboratory.pem"
        self.bundle.write_bytes(public_bundle(self.keys))
        self.public = read_public(self.bundle)

    def look(self, data: bytes) -> Any:
        """What is found in a file by the public key."""
        return look(data, "file", self.public)


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Laboratory:
    return Laboratory(tmp_path_factory.mktemp("keys"))


def problems(files: Any, public: Public) -> list[str]:
    found = (look(data, "file", public).problem for data in files)
    return ["" if one is None else one.code for one in found]


def test_each_file_is_genuine_by_the_public_key_alone(laboratory: Laboratory) -> None:
    text = str(laboratory.seal).encode()
    for data, kind in zip((*laboratory.files, text), ("PDF", "DCC", "JSON", "square code"), strict=True):
        found = laboratory.look(data)
        assert (found.kind, found.number, found.problem) == (kind, "2026-0001", None)
        assert found.digest == record_digest(laboratory.record)
        assert found.key == fingerprint(laboratory.public.keys[0])


def test_the_signed_files_are_what_they_were(laboratory: Laboratory) -> None:
    """The PDF keeps its bytes and stays PDF/A-2b and 1.7, the DCC fits PTB's schema, the record keeps its digest."""
    pdf, dcc, text = laboratory.files
    assert pdf.startswith(laboratory.plain)
    assert len(pdf) - len(laboratory.plain) < 40_000
    added = pdf[len(laboratory.plain) :]
    assert re.search(rb"<pdfaid:part>2</pdfaid:part>\s*<pdfaid:conformance>B", laboratory.plain)
    assert not re.search(rb"/Version|xmpmeta|/Producer|/ModDate|/JavaScript|/EmbeddedFile|/Encrypt", added)
    assert record_digest(laboratory.record).encode() in pdf
    # an annotation of a PDF/A is printed; without a size it needs no look (ISO 19005-2, 6.3.2 and 6.3.3)
    assert re.search(rb"/Subtype /Widget.{0,60}/F 132\s/Rect \[ 0 0 0 0 \]", pdf, re.DOTALL)
    schema = dcc_schema()
    assert schema.validate(etree.fromstring(dcc)), schema.error_log
    assert read_dcc(dcc).digest == record_digest(laboratory.record)
    content = json.loads(text)
    assert record_bytes(unsigned(content)) == record_bytes(laboratory.record)
    assert set(content) - set(laboratory.record) == {"signature"}


@pytest.mark.skipif(shutil.which("pdfsig") is None, reason="pdfsig is not installed")
def test_another_program_finds_the_signature_of_the_pdf_valid(laboratory: Laboratory, tmp_path: Path) -> None:
    """Poppler, with a library of its own; it does not know the laboratory, of course."""
    (tmp_path / "a.pdf").write_bytes(laboratory.pdf)
    said = subprocess.run(["pdfsig", tmp_path / "a.pdf"], capture_output=True, text=True, check=False).stdout
    assert "Signature is Valid" in said
    assert "Total document signed" in said
    assert "ETSI.CAdES.detached" in said


def room(pdf: bytes) -> tuple[int, int]:
    """Where the signature of a PDF stands, from its first bracket to behind its last."""
    found = re.search(rb"/ByteRange *\[ *0 +(\d+) +(\d+)", pdf)
    return int(found[1]), int(found[2])


@pytest.mark.long
@pytest.mark.parametrize("name", ["pdf", "dcc", "json"])
def test_no_byte_can_be_changed(laboratory: Laboratory, name: str) -> None:
    """One bit flipped anywhere, a byte taken out or added: never genuine, unless the XML says the same (C14N)."""
    data = getattr(laboratory, name)
    random = np.random.default_rng(3)
    places = [*random.integers(0, len(data), 150)]
    if name == "pdf":  # the room of the signature: its CMS densely, the zeros behind it, both brackets, what is around
        first, behind = room(data)
        places += [*range(first - 3, first + 4), *random.integers(first, first + 3600, 150)]
        places += [*random.integers(first + 3600, behind, 75), *range(behind - 4, behind + 3), len(data) - 1]
    for turn, place in enumerate(places):
        changed = bytearray(data)
        if turn % 3 == 0:
            del changed[place]
        elif turn % 3 == 1:
            changed.insert(place, 0x20)
        else:
            changed[place] ^= 1 << int(random.integers(0, 7))
        try:
            found = laboratory.look(bytes(changed))
        except FileError:
            continue
        if not found.problem and name == "dcc":
            same = [etree.tostring(etree.fromstring(one), method="c14n") for one in (bytes(changed), data)]
            signature = [re.sub(rb"<ds:Signature .*</ds:Signature>", b"", one, flags=re.DOTALL) for one in same]
            assert signature[0] == signature[1], place
        else:
            assert found.problem, place


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("dcc", b"2026-05-06", b"2027-05-06"),
        ("dcc", b"Driller", b"Drilles"),
        ("json", b"Driller", b"Drilles"),
        ("json", b'"number": "2026-0001"', b'"number": "2026-0002"'),
        ("json", b"\n", b"\n "),
        ("pdf", b"Calibration certificate", b"Calibration certificatf"),
    ],
)
def test_an_edited_file_is_not_genuine(laboratory: Laboratory, name: str, old: bytes, new: bytes) -> None:
    data: bytes = getattr(laboratory, name)
    assert old in data
    assert laboratory.look(data.replace(old, new, 1)).problem == CHANGED


@pytest.mark.parametrize("put", [b"1", b"A", b" ", b"\n", b">", b"(", b"00>/M(void)<"])
@pytest.mark.parametrize("place", [-1, -2, -1000, -20_000])
def test_nothing_but_zeros_fills_the_room_of_a_signature(laboratory: Laboratory, put: bytes, place: int) -> None:
    """It is signed by nobody: another file, a note, a payload in it would be."""
    pdf = laboratory.pdf
    at = room(pdf)[1] - 1 + place
    assert pdf[at : at + 1] == b"0"
    at -= len(put) if at + len(put) > room(pdf)[1] - 1 else 0
    found = laboratory.look(pdf[:at] + put + pdf[at + len(put) :])
    assert found.problem == CHANGED
    assert len(pdf) == len(pdf[:at] + put + pdf[at + len(put) :])


def certificate_of(key: ec.EllipticCurvePrivateKey, name: str = "CN=Somebody", by: str = "") -> bytes:
    """A certificate that a key made out for itself, or an authority for it, PEM."""
    subject, day = x509.Name.from_rfc4514_string(name), datetime(2026, 1, 1)
    made = x509.CertificateBuilder().subject_name(subject).public_key(key.public_key()).serial_number(7)
    made = made.not_valid_before(day).not_valid_after(day.replace(year=2090))
    if by:
        usage = x509.KeyUsage(True, True, False, False, False, False, False, False, False)
        made, key = made.add_extension(usage, critical=True), ec.generate_private_key(ec.SECP256R1())
    made = made.issuer_name(x509.Name.from_rfc4514_string(by or name))
    return made.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)


def _unsigned_attribute(signed: Any) -> None:
    from asn1crypto import cms, core

    one = cms.CMSAttribute({"type": "1.3.6.1.4.1.99999.1", "values": [core.OctetString(b"void")]})
    signed["signer_infos"][0]["unsigned_attrs"] = cms.CMSAttributes([one])


def _another_certificate(signed: Any) -> None:
    """One of the same names by a key of somebody else's."""
    from asn1crypto import pem
    from asn1crypto import x509 as asn1

    name = f"CN={signed['certificates'][0].chosen.issuer.native['common_name']}"
    made = certificate_of(ec.generate_private_key(ec.SECP256R1()), name)
    signed["certificates"].append(asn1.Certificate.load(pem.unarmor(made)[2]))


def _capitals(name: Any) -> Any:
    """The same name to whoever compares names without regard to case."""
    from asn1crypto import x509 as asn1

    return asn1.Name.build({"common_name": name.native["common_name"].replace("inclinometry", "Inclinometry")})


def _renamed(signed: Any) -> None:
    """The laboratory's own certificate says that another made it out."""
    from asn1crypto import x509 as asn1

    signed["certificates"][2].chosen["tbs_certificate"]["issuer"] = asn1.Name.build({"common_name": "Somebody"})


def _strange_kind(signed: Any) -> None:
    one = signed["certificates"][2].chosen["tbs_certificate"]
    one["subject_public_key_info"]["algorithm"]["algorithm"] = "x448"


# what stands in the CMS of a PDF and is signed by nobody
ADDED: dict[str, Callable[[Any], object]] = {
    "an unsigned attribute": _unsigned_attribute,
    "another certificate": _another_certificate,
    "a second signer": lambda s: s["signer_infos"].append(s["signer_infos"][0].copy()),
    "another version": lambda s: s.__setitem__("version", "v3"),
    "another issuer": _renamed,
    "the signer in capitals": lambda s: s["signer_infos"][0]["sid"].chosen.__setitem__(
        "issuer", _capitals(s["signer_infos"][0]["sid"].chosen["issuer"])
    ),
    "another digest": lambda s: s["digest_algorithms"][0].__setitem__("algorithm", "sha512"),
    "another kind of key": _strange_kind,
    "an unknown version": lambda s: s["certificates"][2].chosen["tbs_certificate"].__setitem__("version", 3),
    "no serial number": lambda s: s["certificates"][2].chosen["tbs_certificate"].__setitem__("serial_number", -1),
    "the authority broken": lambda s: s["certificates"][2].chosen.__setitem__("signature_value", b"\xff" * 64),
}


@pytest.mark.parametrize("what", ADDED)
def test_nothing_is_added_to_the_signature_of_a_pdf(laboratory: Laboratory, what: str) -> None:
    """A CMS leaves room for what its signature does not cover: what we do not write there is refused."""
    from asn1crypto import cms

    pdf = laboratory.pdf
    first, behind = room(pdf)
    made = cms.ContentInfo.load(bytes.fromhex(pdf[first + 1 : behind - 1].decode()))
    ADDED[what](made["content"])
    der = made.dump(force=True)
    changed = pdf[: first + 1] + der.hex().upper().ljust(behind - first - 2, "0").encode() + pdf[behind - 1 :]
    assert len(changed) == len(pdf)
    assert laboratory.look(changed).problem == CHANGED


def test_the_digits_of_a_signature_are_spelled_in_one_way(laboratory: Laboratory) -> None:
    pdf = laboratory.pdf
    first, behind = room(pdf)
    changed = pdf[:first] + pdf[first:behind].lower() + pdf[behind:]
    assert laboratory.look(changed).problem == CHANGED


def test_more_behind_a_signed_pdf_is_a_change(laboratory: Laboratory) -> None:
    """An incremental update by another program, as an editor saves it."""
    import io

    from pyhanko.pdf_utils import generic
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    writer = IncrementalPdfFileWriter(io.BytesIO(laboratory.pdf))
    writer.root["/PageLabels"] = generic.NullObject()
    writer.update_root()
    out = io.BytesIO()
    writer.write(out)
    assert laboratory.look(out.getvalue()).problem == CHANGED


def test_another_key_is_named(laboratory: Laboratory, tmp_path: Path) -> None:
    """The wrong public key, and the wrong laboratory under the same name."""
    other = Laboratory(tmp_path / "other")
    signer = fingerprint(laboratory.public.keys[0])
    for data in (*laboratory.files, str(laboratory.seal).encode()):
        found = look(data, "file", other.public)
        assert found.problem == Finding("certificate-key", {"key": signer})
        assert found.signer is not None
    assert all(problems(other.files, laboratory.public))


def test_a_broken_signature_of_another_key_is_not_genuine(laboratory: Laboratory, tmp_path: Path) -> None:
    """It is nobody's, whichever key it names: not what a former key of the laboratory may explain."""
    other = Keys(tmp_path / "other")
    other.make()
    public = Public((str(other.public()),), ())
    pdf, dcc, text = laboratory.files
    content = json.loads(text)
    forged = {**content["signature"], "key": other.make().public}
    for data in (
        pdf.replace(b"/Type /Page\n", b"/Type /Pagf\n") + b"\n%",
        dcc.replace(b"Client", b"Cliont", 1) if b"Client" in dcc else dcc.replace(b"deg", b"dag", 1),
        text.replace(b'"2026-0001"', b'"2026-0002"', 1),
        canonical({**content, "signature": forged}),
    ):
        assert data not in laboratory.files
        found = look(data, "file", public)
        assert found.problem is not None
        assert found.signer is None
        assert found.problem.code != "certificate-key"


@pytest.mark.parametrize("end", [100, -1000, -10])
def test_a_pdf_cut_off_is_said_in_words(laboratory: Laboratory, end: int) -> None:
    found = laboratory.look(laboratory.pdf[:end])
    assert found.problem == CHANGED


def test_parts_of_two_certificates_are_not_one(laboratory: Laboratory, tmp_path: Path) -> None:
    """The signature of one DCC under the content of another; an unsigned file; the seal of another record."""
    other = record(number="2026-0002")
    one, two = etree.fromstring(laboratory.dcc), etree.fromstring(dcc_bytes(other))
    two.append(one[-1])
    public = laboratory.public
    assert look(etree.tostring(two), "file", public).problem == CHANGED
    # the whole signed document hidden inside of another
    wrapper = etree.fromstring(dcc_bytes(other))
    wrapper.append(etree.fromstring(laboratory.dcc))
    assert look(etree.tostring(wrapper), "file", public).problem
    unsigned_files = [certificate_pdf(other), dcc_bytes(other), record_bytes(other)]
    assert problems(unsigned_files, public) == ["certificate-unsigned"] * 3
    moved = json.loads(record_bytes(other)) | {"signature": json.loads(laboratory.json)["signature"]}
    assert look(record_bytes(moved), "file", public).problem == CHANGED
    forged = laboratory.seal._replace(number="2026-0009")
    assert problems([str(forged).encode()], public) == ["key-forged"]
    assert parse_seal("anything else") is None
    with refused("certificate-not-one", error=FileError):
        look(b"anything else", "file", public)


DS = "http://www.w3.org/2000/09/xmldsig#"
XADES = "http://uri.etsi.org/01903/v1.3.2#"


def forged(data: bytes) -> list[Any]:
    """The parts of a certificate with another number and other values."""
    parts = [part for part in etree.fromstring(data) if etree.QName(part).localname != "Signature"]
    for part in parts:
        for one in part.iter("{*}valueXMLList"):
            one.text = " ".join("9" for _ in one.text.split())
        for one in part.iter("{*}value"):
            one.text = "2026-0007" if one.text == "2026-0001" else one.text
    return parts


def _object(*parts: Any) -> Any:
    made = etree.Element(f"{{{DS}}}Object")
    made.extend(parts)
    return made


def _in_front(whole: Any, parts: list[Any]) -> None:
    for one in reversed(parts):
        whole.insert(0, one)


def _another_root(root: Any, signature: Any, new: list[Any]) -> None:
    inner = etree.Element(root.tag)
    inner.extend([part for part in root if part is not signature])
    signature.append(_object(inner))
    _in_front(root, new)


def _same_id(signature: Any, new: list[Any]) -> None:
    new[0].set("Id", signature[2].get("Id"))
    signature[3].extend(new)


def _id_elsewhere(signature: Any, new: list[Any]) -> None:
    old = etree.fromstring(etree.tostring(signature[2]))
    signature[2].set("ID", signature[2].attrib.pop("Id"))
    signature[2].extend([*new, old])


def _another_transform(signature: Any) -> None:
    step = next(signature.iter(f"{{{DS}}}Transform"))
    step.addprevious(etree.Element(step.tag, Algorithm="http://www.w3.org/TR/1999/REC-xpath-19991116"))


def _within(signature: Any, name: str, new: list[Any]) -> None:
    made = etree.Element(name)
    made.extend(new)
    signature.append(made)


# root, signature, forged parts: put where the signature does not see them
WRAPPED: dict[str, Callable[[Any, Any, list[Any]], object]] = {
    "object, signature in front": lambda r, s, n: (s.append(_object(*n)), r.insert(0, s)),
    "object at the end": lambda r, s, n: s.append(_object(*n)),
    "an empty object": lambda r, s, n: s.append(_object()),
    "in the object": lambda r, s, n: s[3].extend(n),
    "in front of the properties": lambda r, s, n: _in_front(s[3], n),
    "unsigned properties": lambda r, s, n: _within(s[3][0], f"{{{XADES}}}UnsignedProperties", n),
    "in the value": lambda r, s, n: s[1].extend(n),
    "in the key": lambda r, s, n: s[2].extend(n),
    "in what is said of the references": lambda r, s, n: s[0].extend(n),
    "a document in the key": lambda r, s, n: _within(s[2], r.tag, n),
    "another root around": _another_root,
    "the signature in front": lambda r, s, n: r.insert(0, s),
    "two signatures": lambda r, s, n: r.append(etree.fromstring(etree.tostring(s))),
    "the signature deeper": lambda r, s, n: r[-2].append(s),
    "parts twice": lambda r, s, n: _in_front(r, n),
    "one id twice": lambda r, s, n: _same_id(s, n),
    "the key's id elsewhere": lambda r, s, n: _id_elsewhere(s, n),
    "another transform": lambda r, s, n: _another_transform(s),
    "one reference less": lambda r, s, n: s[0].remove(s[0][-1]),
    "words in between": lambda r, s, n: setattr(s[3], "text", "void"),
    "words behind": lambda r, s, n: setattr(s, "tail", "void"),
    "words in the value": lambda r, s, n: setattr(s[1], "text", f"{s[1].text}#void#"),
    "an attribute": lambda r, s, n: s[3].set("Encoding", "void"),
}


@pytest.mark.parametrize("way", WRAPPED)
def test_a_signature_wrapped_around_other_contents_is_refused(laboratory: Laboratory, way: str) -> None:
    """XML signature wrapping: what the signature does not cover has no place in the file; nor is it read."""
    data = laboratory.dcc
    root = etree.fromstring(data)
    WRAPPED[way](root, root[-1], forged(data))
    changed = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    assert etree.tostring(root, method="c14n") != etree.tostring(etree.fromstring(data), method="c14n")
    found = laboratory.look(changed)
    assert found.problem
    assert found.number in ("2026-0001", "")
    try:
        said = read_dcc(changed)
    except FileError:
        return
    was = read_dcc(data)
    assert (said.number, said.digest, said.parameters) == (was.number, was.digest, was.parameters)


@pytest.mark.parametrize("put", [b"<!---->", b"<?cut?>"])
def test_what_splits_a_value_is_refused(laboratory: Laboratory, put: bytes) -> None:
    """XAdES signs without comments, and a reader takes the text before one for the value; also beside the root."""
    data = laboratory.dcc
    at = data.index(b"</si:value>") - 1 if b"</si:value>" in data else data.index(b"2026-0001") + 2
    for changed in (data[:at] + put + data[at:], data + put):
        assert laboratory.look(changed).problem == CHANGED


def test_a_certificate_of_before_the_key_was_rotated(tmp_path: Path) -> None:
    """What is published afterwards proves old and new ones."""
    laboratory = Laboratory(tmp_path / "keys")
    laboratory.keys.rotate("every year")
    laboratory.bundle.write_bytes(public_bundle(laboratory.keys))
    public = read_public(laboratory.bundle)
    assert len(public.keys) == 2
    assert problems(laboratory.files, public) == ["", "", ""]
    made = seal(laboratory.record, laboratory.keys)
    new = sign_files(laboratory.record, None, dcc_bytes(laboratory.record), made, laboratory.keys)
    assert problems(new[1:], public) == ["", ""]
    assert all(problems(new[1:], laboratory.public))
    laboratory.keys.begin_anew("stolen")
    laboratory.bundle.write_bytes(public_bundle(laboratory.keys))
    assert all(problems(new[1:], read_public(laboratory.bundle)))


def test_a_certificate_of_an_authority(tmp_path: Path) -> None:
    """Its key signs PDF and XML; who has it in the published file finds them genuine."""
    laboratory = Laboratory(tmp_path / "keys")
    private = ec.generate_private_key(ec.SECP384R1())
    pem = private.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    own = certificate_of(private, "CN=Stand and Son,C=NO", by="CN=Authority")
    (tmp_path / "keys" / "document.pem").write_bytes(pem + own)
    files = sign_files(
        laboratory.record, laboratory.plain, dcc_bytes(laboratory.record), laboratory.seal, laboratory.keys
    )
    assert len(problems(files[:2], laboratory.public)) == 2
    assert all(problems(files[:2], laboratory.public))
    laboratory.bundle.write_bytes(public_bundle(laboratory.keys))
    assert problems(files, read_public(laboratory.bundle)) == ["", "", ""]
    # what would not be found genuine is not signed
    with (tmp_path / "keys" / "document.pem").open("ab") as stream:
        stream.write(certificate_of(ec.generate_private_key(ec.SECP256R1())))
    with refused("key-document", error=LedgerError):
        sign_files(laboratory.record, None, None, laboratory.seal, laboratory.keys)


def test_what_looks_like_a_signature_and_is_none(laboratory: Laboratory) -> None:
    """Empty and broken certificates, no certificate, a signature that is nowhere."""
    root = etree.fromstring(laboratory.dcc)
    for text in ("", "AAAA", "\u0431"):
        for one in root.iter("{*}X509Certificate"):
            one.text = text
        assert laboratory.look(etree.tostring(root)).problem
    pdf = laboratory.pdf
    for data in (pdf[: len(pdf) // 2], pdf[:-900], b"%PDF-1.7\n", pdf.replace(b"/SigFlags 3", b"/SigFlags 0")):
        assert laboratory.look(data).problem
    assert digest_bytes(pdf) != digest_bytes(laboratory.plain)
