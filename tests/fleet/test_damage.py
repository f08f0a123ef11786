"""Every file of a fleet that is not what was committed is named, with a remedy that is true."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.refusals import coded, refused

from inclinometry.errors import FileError
from inclinometry.fleet import audit, checksums, commands, raw
from inclinometry.fleet.plan import table
from inclinometry.fleet.store import Store

from .conftest import Scene
from .test_fleet import done, planned


def flip(path: Path, place: float = 0.5, bit: int = 0) -> None:
    """Turn one bit of a file round, at a share of its length."""
    content = bytearray(path.read_bytes())
    content[int(place * (len(content) - 1))] ^= 1 << bit
    path.write_bytes(bytes(content))


@pytest.mark.parametrize("place", [0.02, 0.3, 0.6, 0.95])
@pytest.mark.parametrize(
    "files",
    ["raw/_catalogue/*.parquet", "raw/_catalogue/_delta_log/*.json", "windows/_delta_log/*.json", "*/_checksums/*"],
)
def test_a_flipped_bit_of_what_says_what_is_there_is_named(
    scene: Scene, files: str, place: float, capsys: pytest.CaptureFixture[str]
) -> None:
    done(scene)
    path = sorted(Path(scene.fleet).glob(files))[-1]
    whole = path.read_bytes()
    flip(path, place)
    name = path.relative_to(scene.fleet).as_posix()
    ((damaged, _),) = audit.verify(Store(scene.fleet))
    assert name in damaged
    with refused("fleet-table", "fleet-checksums", error=FileError) as raised:
        planned(scene)
    assert name in str(raised.value.path)
    if "_catalogue" in files:
        with refused("fleet-table", "fleet-checksums", error=FileError):
            commands.add([scene.folder / "runs"], fleet=scene.fleet, pattern="{tool}_{run}_{date}")
    assert commands.verify(fleet=scene.fleet) == 1
    assert "1 file damaged" in capsys.readouterr().out
    path.write_bytes(whole)
    assert list(audit.verify(Store(scene.fleet))) == []


def test_a_damaged_result_is_removed_and_made_anew(scene: Scene) -> None:
    done(scene)
    store = Store(scene.fleet)
    digest = audit.digest(store, "windows")
    random = np.random.default_rng(1)
    for name in table(store, "windows").paths():
        path = Path(scene.fleet, name)
        whole = path.read_bytes()
        for _ in range(5):
            flip(path, random.uniform(), int(random.integers(8)))
            ((damaged, found),) = audit.verify(store)
            assert damaged == name
            assert found.code == "fleet-result-changed"
            path.write_bytes(whole)
    flip(path)
    with refused("fleet-result-changed", name=name):
        audit.digest(store, "windows")
    path.unlink()
    assert coded(found for _, found in audit.verify(store)) == ["fleet-result-gone"]
    todo = planned(scene)
    assert ([task.target for task in todo.todo], todo.current) == ([name], 5)
    assert done(scene).made == 1
    assert list(audit.verify(store)) == []
    assert audit.digest(store, "windows") == digest


def test_a_result_that_is_not_current_is_not_taken_over_damaged(scene: Scene) -> None:
    done(scene)
    store = Store(scene.fleet)
    name = sorted(table(store, "windows").paths())[0]
    table(store, "windows").commit({}, [name], {})
    flip(Path(scene.fleet, name))
    found = done(scene)
    assert (found.adopted, found.made) == (0, 0)
    ((_, problem),) = found.problems
    assert (problem.code, problem.values["name"]) == ("fleet-result-changed", name)
    Path(scene.fleet, name).unlink()
    assert done(scene).made == 1
    assert list(audit.verify(store)) == []


@pytest.mark.parametrize("product", ["windows", raw.CATALOGUE])
def test_a_log_that_is_damaged_and_removed_is_made_anew(scene: Scene, product: str) -> None:
    """By what its remedy says: results are made anew, since nothing tells what they were; runs are added again."""
    done(scene)
    store = Store(scene.fleet)
    log = Path(scene.fleet, product, "_delta_log")
    sorted(log.glob("*.json"))[-1].unlink()
    ((_, problem),) = audit.verify(store)
    assert (problem.code, problem.values["folder"]) == ("fleet-table", product)
    shutil.rmtree(log.parent)
    if product != "windows":
        commands.add([scene.folder / "runs"], fleet=scene.fleet, pattern="{tool}_{run}_{date}")
    found = done(scene)
    assert (found.made, found.adopted) == (6 if product == "windows" else 0, 0)
    assert list(audit.verify(store)) == []
    assert audit.unrecorded(store) == []


def test_a_fleet_from_before_checksums_is_read_and_says_so(scene: Scene, capsys: pytest.CaptureFixture[str]) -> None:
    done(scene)
    for folder in Path(scene.fleet).rglob(checksums.FOLDER):
        shutil.rmtree(folder)
    assert not planned(scene).todo
    assert commands.verify(fleet=scene.fleet) == 0
    said = capsys.readouterr()
    assert "[fleet-no-checksums]" in said.err
    assert "every file with a checksum is what it was" in said.out
    for path in Path(scene.fleet).glob("windows/**/part-*.parquet"):
        flip(path, 0.2)
        assert next(audit.verify(Store(scene.fleet)))[1].code == "fleet-result-changed"
        break
    # nothing of the libraries gets through where the bytes are no table any more
    sorted(Path(scene.fleet).glob("raw/_catalogue/*.parquet"))[0].write_bytes(b"PAR1" + bytes(100))
    with refused("fleet-table", error=FileError):
        planned(scene)


def test_many_files_of_checksums_are_put_together(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    for number in range(70):
        checksums.record(store, "windows", {f"windows/part-{number}.parquet": f"sha256:{number}"})
    assert len(list(Path(tmp_path, "windows", checksums.FOLDER).iterdir())) < 10
    have = checksums.recorded(store, "windows")
    assert have == {f"windows/part-{number}.parquet": {f"sha256:{number}"} for number in range(70)}
