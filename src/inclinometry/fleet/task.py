"""One file of counts to one file of results: the only thing that workers do."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from inclinometry.arrays import Array
from inclinometry.digest import digest_file
from inclinometry.errors import InclinometryError, InputError, refused
from inclinometry.files.tool_json import calibration_from
from inclinometry.findings import Finding
from inclinometry.fleet.checksums import digest_of
from inclinometry.fleet.raw import channel_names, row_groups
from inclinometry.fleet.store import Store
from inclinometry.sensors import Tool

VERSION: Final = {"windows": 1, "angles": 1}
"""Of each product; a new one makes everything again."""
BATCH: Final = 1 << 18  # rows at a time: little memory whatever the row groups of the file
KINDS: Final = ("accelerometer", "magnetometer")


class Task(NamedTuple):
    """What a worker is given.

    raw : file of counts, `size` its bytes as the catalogue knows it. window_ns : 0 for angles.
    target : name of the result, which tells what it is made of; known : its digests where it was made before.
    footer : kept in the result. calibration : content of the tool.json.
    """

    address: str
    raw: str
    target: str
    product: str
    window_ns: int
    footer: Mapping[str, str]
    calibration: Mapping[str, Any]
    size: int
    known: tuple[str, ...] = ()


class Receipt(NamedTuple):
    """What a worker gives back: the file that is there now, or why it is not.

    adopted : it was there already. seconds : of work. digest : of the file.
    """

    target: str
    rows: int = 0
    size: int = 0
    samples: int = 0
    seconds: float = 0.0
    adopted: bool = False
    problem: Finding | None = None
    digest: str = ""


def key(input_digest: str, calibration_digest: str, product: str, window_ns: int) -> str:
    """The name of a result: 20 hexadecimal digits of what it is made of and how.

    Examples
    --------
    >>> len(key("sha256:aa", "sha256:bb", "windows", 10**9))
    20
    """
    said = {
        "calibration": calibration_digest,
        "input": input_digest,
        "options": {"window_ns": window_ns},
        "product": f"{product}/{VERSION[product]}",
    }
    canonical = json.dumps(said, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:20]


def schema(product: str) -> Any:
    """Columns of a product.

    `windows`: start of the window, samples that count, means of their angles (of a tool that turns within the window,
    the toolface's says nothing), their standard deviations, root mean square of gravity and field in units of the
    calibration's, dip. `angles`: the three angles of each sample.
    """
    import pyarrow as pa

    angles = ["inclination_deg", "azimuth_deg", "toolface_deg"]
    first = [pa.field("time_ns", pa.int64(), nullable=False)]
    if product == "windows":
        first.append(pa.field("samples", pa.int32(), nullable=False))
        angles += [f"sd_{name}" for name in angles] + ["gravity", "field", "dip_deg"]
    return pa.schema([*first, *(pa.field(name, pa.float32(), nullable=False) for name in angles)])


def footer_of(store: Store, name: str) -> dict[str, str]:
    """What a result says of itself: its footer's entries that begin with "inclinometry.", without that.

    Raises
    ------
    InputError
        It is not there, or no result of a fleet.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with store.reading(name) as stream:
            metadata = pq.ParquetFile(stream).schema_arrow.metadata or {}
        start = "inclinometry."
        own = {k.decode(): v.decode() for k, v in metadata.items()}
    except (pa.ArrowException, OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise refused("fleet-result-changed", {"name": name, "reason": str(error)[:200]}) from None
    return {k.removeprefix(start): v for k, v in own.items() if k.startswith(start)}


def run(task: Task) -> Receipt:
    """Do a task: the same bytes whoever does it, under a name that says what it is made of.

    A result that is there already is adopted. What goes wrong with the file is said in the receipt, not raised.
    """
    import pyarrow as pa

    begun = time.perf_counter()
    store = Store(task.address)
    try:
        there = store.size(task.target)
        if there is not None:
            return _adopted(store, task, there)
        if store.size(task.raw) != task.size:
            raise refused("fleet-raw-changed", {"reason": f"{store.size(task.raw)} B"})
        rows, size, samples, digest = _done(store, task)
    except InclinometryError as error:
        return Receipt(task.target, problem=error.finding)
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        said = (str(error).strip().splitlines() or [type(error).__name__])[0][:300]
        return Receipt(task.target, problem=Finding("fleet-raw-changed", {"reason": said}))
    return Receipt(task.target, rows, size, samples, time.perf_counter() - begun, digest=digest)


def _adopted(store: Store, task: Task, size: int) -> Receipt:
    import pyarrow.parquet as pq

    if footer_of(store, task.target).get("key") != task.footer["key"]:
        raise refused("fleet-result-changed", {"name": task.target, "reason": "key"})
    found = digest_of(store, task.target)
    if task.known and found not in task.known:
        raise refused("fleet-result-changed", {"name": task.target, "reason": "SHA-256"})
    if not task.known:
        check_pages(store, task.target)
    with store.reading(task.target) as stream:
        rows = int(pq.ParquetFile(stream).metadata.num_rows)
    return Receipt(task.target, rows, size, adopted=True, digest=found)


def check_pages(store: Store, name: str) -> None:
    """Read every page of a result against its own checksum; InputError where one is damaged."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with store.reading(name) as stream:
            source = pq.ParquetFile(stream, buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)
            for _ in source.iter_batches(batch_size=BATCH, use_threads=False):
                pass
    except (pa.ArrowException, OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise refused("fleet-result-changed", {"name": name, "reason": str(error).splitlines()[0][:200]}) from None


def _done(store: Store, task: Task) -> tuple[int, int, int, str]:
    import pyarrow.parquet as pq

    convert, columns = _prepared(json.dumps(task.calibration))
    wanted = schema(task.product).with_metadata({f"inclinometry.{k}": v for k, v in task.footer.items()})
    angles = [np.empty(BATCH, dtype=np.float32) for _ in range(3)]
    samples = 0
    make = _windows(task.window_ns) if task.product == "windows" else _angles
    with store.reading(task.raw) as stream:
        # page checksums: without them a flipped bit is read as a number
        source = pq.ParquetFile(stream, buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)
        with store.staged(task.target.rpartition("/")[0]) as (scratch, publish):
            with row_groups(scratch, wanted) as rows:
                for batch in source.iter_batches(batch_size=BATCH, columns=["time_ns", *columns], use_threads=False):
                    clock = batch.column("time_ns").to_numpy()
                    samples += len(clock)
                    values = {name: batch.column(name).to_numpy() for name in columns}
                    rows.add(make(clock, *convert(values), angles))
                if (rest := make(None, [], None, angles)) is not None:
                    rows.add(rest)
            size, digest = scratch.stat().st_size, digest_file(scratch)
            publish(task.target)
    return rows.rows, size, samples, digest


Convert = Callable[[Mapping[str, Array]], tuple[list[Array], Array]]


@lru_cache(maxsize=64)
def _prepared(content: str) -> tuple[Convert, list[str]]:
    """`converter` of a tool.json, which takes longer to check than a million samples to convert."""
    return converter(calibration_from(json.loads(content), "the calibration").tool)


def converter(tool: Tool) -> tuple[Convert, list[str]]:
    """What turns columns into six channels and 24 coefficients, and the columns it needs.

    Triads of three sensors without temperature terms go through as stored; of others the fields are worked out first.
    """
    triads = [tool.triads.get(kind) for kind in KINDS]
    found = [triad for triad in triads if triad is not None and triad.full]
    if lacking := tuple(set(KINDS).difference(triad.kind for triad in found)):
        raise refused("input-triads", {"lacking": lacking, "needed": KINDS})
    names = [channel_names(triad.kind, triad.count) for triad in found]
    flat = [name for of in names for name in of]
    if all(triad.count == 3 and triad.degree == 0 for triad in found):
        inverses = [triad.inverse().ravel() for triad in found]
        plain = np.concatenate([*inverses, *(triad.offset[0] for triad in found)])
        return (lambda values: ([values[name] for name in flat], plain)), flat
    heat = any(triad.degree for triad in found)
    unit = np.concatenate([np.eye(3).ravel(), np.eye(3).ravel(), np.zeros(6)])

    def fields(values: Mapping[str, Array]) -> tuple[list[Array], Array]:
        temperature = values["temperature_degC"].astype(np.float64) if heat else None
        channels: list[Array] = []
        for triad, of in zip(found, names, strict=True):
            signals = np.stack([values[name].astype(np.float64) for name in of], axis=-1)
            lost: Any = ~np.isfinite(signals).all(axis=-1)
            if temperature is not None:
                lost = lost | ~np.isfinite(temperature)
            inside = None if temperature is None else np.where(lost, triad.reference_temperature, temperature)
            seen = triad.field(np.where(lost[:, None], 0.0, signals), inside)
            seen[lost] = np.nan
            channels += [np.ascontiguousarray(seen[:, axis], dtype=np.float32) for axis in range(3)]
        return channels, unit

    return fields, [*flat, *(["temperature_degC"] if heat else [])]


def _angles(clock: Any, channels: list[Any], c: Any, out: list[Any]) -> Any:
    from inclinometry.fleet import _kernels

    if clock is None:
        return None
    return [clock, *(angle.copy() for angle in _kernels.degrees(channels, c, out))]


def _windows(width: int) -> Callable[..., Any]:
    """Windows counted from the first sample; one that a batch cuts is kept for the next."""
    from inclinometry.fleet import _kernels

    origin: int | None = None
    kept: list[Any] = []
    coefficients: Any = None

    def make(clock: Any, channels: list[Any], c: Any, _: list[Any]) -> Any:
        nonlocal origin, kept, coefficients
        last = clock is None
        if last:
            if not kept:
                return None
            pieces, kept = kept, []
        else:
            origin = int(clock[0]) if origin is None else origin
            coefficients = c
            pieces = [clock, *channels]
            if kept:
                pieces = [np.concatenate(pair) for pair in zip(kept, pieces, strict=True)]
            # the last window may go on in the next batch
            begin = origin + (int(pieces[0][-1]) - origin) // width * width
            cut = int(np.searchsorted(pieces[0], begin))
            kept = [piece[cut:].copy() for piece in pieces]
            pieces = [np.ascontiguousarray(piece[:cut]) for piece in pieces]
        start, count, rows = _kernels.windows(pieces[0], pieces[1:], coefficients, origin or 0, width)
        columns = rows.astype(np.float32).T
        columns[1:3][columns[1:3] >= 360.0] = 0.0  # just short of a turn, rounded
        return [start, count, *columns]

    return make
