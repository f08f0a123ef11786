"""Digests agree with the published test vectors of SHA-256 and between bytes and files."""

from inclinometry.digest import digest_bytes, digest_file

# FIPS 180-2, appendix B.1
ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_published_vector():
    assert digest_bytes(b"abc") == f"sha256:{ABC}"


def test_a_file_has_the_digest_of_its_bytes(tmp_path):
    data = bytes(range(256)) * 5000  # longer than one buffer
    path = tmp_path / "data.bin"
    path.write_bytes(data)
    assert digest_file(path) == digest_file(str(path)) == digest_bytes(data)
