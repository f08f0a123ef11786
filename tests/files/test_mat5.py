"""MATLAB files: sound ones of every kind pass, a damaged one is refused before the compiled reader can crash on it."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import eye_array

from inclinometry.files._mat5 import check_elements

CONTENT = {
    "long_name_of_a_column": np.arange(50.0),
    "md": np.arange(3, dtype=np.int16),
    "z": np.array([1.0 + 2.0j, 3.0]),
    "flag": np.array([True, False]),
    "text": "a text",
    "structure": {"one": np.arange(3.0), "two": {"deep": 1.0}},
    "cells": np.array([np.arange(2.0), "text", np.zeros(0)], dtype=object),
    "sparse": eye_array(3).tocsc(),
    "empty": np.zeros((0, 3)),
}


@pytest.mark.parametrize("packed", [True, False])
def test_sound_files_pass(tmp_path, packed):
    savemat(tmp_path / "a.mat", CONTENT, do_compression=packed)
    check_elements((tmp_path / "a.mat").read_bytes())


def test_each_changed_tag_is_refused_or_read(tmp_path):
    """In a process of its own: what is let through must not end it."""
    savemat(tmp_path / "a.mat", CONTENT)
    script = """
import contextlib, io, random, sys, warnings, zlib
from scipy.io import loadmat
from inclinometry.files._mat5 import check_elements
warnings.simplefilter("ignore")
data, chance, refused = open(sys.argv[1], "rb").read(), random.Random(1), 0
for _ in range(1500):
    made = bytearray(data)
    for _ in range(chance.choice((1, 2, 20))):
        made[chance.randrange(128, len(made))] ^= 1 << chance.randrange(8)
    try:
        check_elements(bytes(made))
    except (ValueError, zlib.error):
        refused += 1
        continue
    with contextlib.suppress(Exception):
        loadmat(io.BytesIO(bytes(made)))
print(refused)
"""
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "a.mat")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-500:]
    assert int(done.stdout) > 300


@pytest.mark.parametrize("place", range(124, 128))
def test_a_header_of_no_known_version_is_refused(tmp_path, place):
    """A version the check does not know is none it lets through: scipy's reader takes 1.16 for 1.0."""
    savemat(tmp_path / "a.mat", CONTENT)
    made = bytearray((tmp_path / "a.mat").read_bytes())
    made[place] ^= 0x10
    with pytest.raises(ValueError, match="neither version 4 nor 5"):
        check_elements(bytes(made))


def test_version_4_passes(tmp_path):
    savemat(tmp_path / "a.mat", {"md": np.arange(3.0)}, format="4")
    check_elements((tmp_path / "a.mat").read_bytes())


def element(kind, content, order="<"):
    """One data element, filled up to eight bytes unless it is a packed one."""
    return struct.pack(f"{order}II", kind, len(content)) + content + bytes(0 if kind == 15 else -len(content) % 8)


def matrix(*parts, order="<", of=6, rows=(1, 2), name=b"a"):
    """A matrix of doubles; `parts` stand behind flags, dimensions and name."""
    flags = element(6, struct.pack(f"{order}II", of, 0), order)
    size = element(5, struct.pack(f"{order}{len(rows)}i", *rows), order)
    return element(14, flags + size + element(1, name, order) + b"".join(parts), order)


def mat(*elements, order="<"):
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100)
    return head + (b"IM" if order == "<" else b"MI") + b"".join(elements)


TWO = element(9, struct.pack("<2d", 1.0, 2.0))


def test_files_put_together_by_hand_pass():
    """In both orders of bytes; a small element; an empty cell; cells in cells to the depth that is allowed."""
    check_elements(mat(matrix(TWO)))
    check_elements(mat(matrix(element(9, bytes(16), ">"), order=">"), order=">"))
    check_elements(mat(matrix(struct.pack("<HH", 1, 4) + b"1234", rows=(4, 1), of=9)))
    check_elements(mat(element(14, b"")))
    check_elements(mat(element(15, zlib.compress(matrix(TWO)))))
    check_elements(mat(matrix(matrix(matrix(TWO), of=1, rows=(1, 1)), of=1, rows=(1, 1))))
    packed = matrix(TWO)
    for _ in range(19):
        packed = element(15, zlib.compress(packed))
    check_elements(mat(packed))
    with pytest.raises(ValueError, match="nested too deep"):
        check_elements(mat(element(15, zlib.compress(element(15, zlib.compress(packed))))))


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        (b"\0" * 7, "an element is cut off"),
        (struct.pack("<HH", 1, 5) + b"12345678", "a small element of more than four bytes"),
        (element(8, b"12345678"), "an element of type 8 and 8 bytes"),
        (element(9, bytes(16))[:-8], "an element of type 9 and 16 bytes"),
        (element(15, zlib.compress(matrix(TWO))[:-4]), "a packed element does not end"),
        (element(14, TWO), "a matrix without flags, dimensions and name"),
        (matrix(TWO, rows=(1,)), "a matrix without flags, dimensions and name"),
        (matrix(TWO, rows=(-1, 2)), "a matrix of class 6, dimensions"),
        (matrix(TWO, rows=(1000, 1000)), "a matrix of class 6, dimensions"),
        (matrix(TWO, of=16), "a matrix of class 16, dimensions"),
        (matrix(), "a matrix of numbers without numbers"),
        (matrix(element(16, b"text")), "a matrix of numbers without numbers"),
        (matrix(TWO, TWO, of=5, rows=(10**6, 10**6)), "a matrix of numbers without numbers"),
        (matrix(matrix(), of=1, rows=(1, 1)), "a matrix of numbers without numbers"),
    ],
)
def test_what_is_not_put_together_as_the_format_says(elements, words):
    with pytest.raises(ValueError, match=words):
        check_elements(mat(elements))


def test_a_sparse_matrix_may_be_larger_than_its_file():
    check_elements(mat(matrix(element(5, bytes(8)), element(5, bytes(8)), TWO, of=5, rows=(10**6, 10**6))))
