"""Files as they are opened: what has no end, no place or no measure is refused in one sentence."""

from __future__ import annotations

import contextlib
import os
import sys
import threading

import pytest

from inclinometry.digest import digest_file
from inclinometry.errors import FileError
from inclinometry.files import json_codec, toml_keys
from inclinometry.opening import LARGEST_RECORD, LARGEST_SETTINGS, opened, whole

UNIX = pytest.mark.skipif(sys.platform == "win32", reason="devices and pipes of Unix")


def test_a_file_up_to_its_size_and_one_byte_more(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"x" * 1000)
    assert whole(path, 1000) == b"x" * 1000
    with pytest.raises(FileError, match=r"a\.bin: it has 1,000 bytes; allowed 999: is it the right file\?"):
        whole(path, 999)
    with pytest.raises(FileError, match="allowed 999: split it"):
        whole(path, 999, "split it")


@pytest.mark.parametrize(("read", "largest"), [
    (json_codec.load, LARGEST_RECORD), (lambda path: toml_keys.load(path, ()), LARGEST_SETTINGS),
])  # fmt: skip
def test_a_huge_file_is_not_read(tmp_path, read, largest):
    # sparse: it takes no room on the disk, and would take all of the memory
    with (tmp_path / "huge").open("wb") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(FileError, match=f"it has 1,099,511,627,776 bytes; allowed {largest:,}"):
        read(tmp_path / "huge")


@UNIX
@pytest.mark.parametrize("read", [json_codec.load, lambda path: toml_keys.load(path, ()), digest_file])
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom"])
def test_a_device_has_no_end(read, device):
    with pytest.raises(FileError, match="this is a device, which has no end; give the name of a file"):
        read(device)


@UNIX
@pytest.mark.parametrize(("size", "fits"), [(1000, True), (1001, False), (5_000_000, False)])
def test_a_pipe_is_read_up_to_the_limit(tmp_path, size, fits):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    def write():
        with contextlib.suppress(BrokenPipeError):  # the reader had enough
            pipe.write_bytes(b"x" * size)

    writer = threading.Thread(target=write)
    writer.start()
    if fits:
        assert len(whole(pipe, 1000)) == size
    else:
        with pytest.raises(FileError, match="it has more than 1,000 bytes; allowed 1,000"):
            whole(pipe, 1000)
    writer.join(60.0)
    assert not writer.is_alive()


@UNIX
def test_what_the_system_says_of_a_name(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for path, said in (
        (tmp_path / "none", "no such file"),
        (tmp_path, "this is a folder"),
        (tmp_path / ("x" * 300), "File name too long"),
        (tmp_path / "file" / "below", "Not a directory"),
        (tmp_path / "loop", "symbolic links"),
        ("a\0b", "null byte"),
    ):
        with pytest.raises(FileError, match=said), opened(path):
            pass
