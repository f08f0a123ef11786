"""MATLAB files: sound ones of every kind pass, a damaged one is refused before the compiled reader can crash on it."""

from __future__ import annotations

import subprocess
import sys

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
