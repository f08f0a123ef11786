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
from inclinometry.errors import InclinometryError, InputError
from inclinometry.files.tool_json import calibration_from
from inclinometry.fleet.raw import ROW_GROUP, channel_names, encoding
from inclinometry.fleet.store import Store
from inclinometry.sensors import Tool

VERSION: Final = {"windows": 1, "angles": 1}
"""Of each product; a new one makes everything anew."""
BATCH: Final = 1 << 18  # rows at a time: little memory whatever the row groups of the file
_CANONICAL: Final = json.JSONEncoder(sort_keys=True, separators=(",", ":"))
KINDS: Final = ("accelerometer", "magnetometer")


class Task(NamedTuple):
    """What a worker is given.

    address : of the store. raw : file of counts. target : name of the result, which tells what it is made of.
    product : "windows" or "angles". window_ns : length of a window, 0 of angles.
    footer : kept in the result: product, input, calibration, certificate, key, code.
    calibration : content of the tool.json.
    size : bytes of `raw` as the catalogue knows it.
    """

    address: str
    raw: str
    target: str
    product: str
    window_ns: int
    footer: Mapping[str, str]
    calibration: Mapping[str, Any]
    size: int


class Receipt(NamedTuple):
    """What a worker gives back: the file that is there now, or why it is not.

    adopted : it was there already. seconds : of work.
    """

    target: str
    rows: int = 0
    size: int = 0
    samples: int = 0
    seconds: float = 0.0
    adopted: bool = False
    problem: str = ""


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
    return hashlib.sha256(_CANONICAL.encode(said).encode()).hexdigest()[:20]


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
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{name}: not a Parquet file, or a damaged one ({str(error)[:200]})") from None
    start = "inclinometry."
    return {k.decode().removeprefix(start): v.decode() for k, v in metadata.items() if k.decode().startswith(start)}


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
        found = store.size(task.raw)
        if found != task.size:
            has = "it is gone" if found is None else f"it has {found} bytes"
            raise InputError(f"{has}, {task.size} bytes when it was added; put it back from a copy")
        rows, size, samples = _done(store, task)
    except InclinometryError as error:
        return Receipt(task.target, problem=f"{task.raw}: {error}")
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        said = (str(error).strip().splitlines() or [type(error).__name__])[0][:300]
        return Receipt(task.target, problem=f"{task.raw}: a damaged file ({said}); put it back from a copy")
    return Receipt(task.target, rows, size, samples, time.perf_counter() - begun)


def _adopted(store: Store, task: Task, size: int) -> Receipt:
    import pyarrow.parquet as pq

    if footer_of(store, task.target).get("key") != task.footer["key"]:
        raise InputError(f"{task.target} is in its place and is another file; remove it")
    with store.reading(task.target) as stream:
        rows = int(pq.ParquetFile(stream).metadata.num_rows)
    return Receipt(task.target, rows, size, adopted=True)


def _done(store: Store, task: Task) -> tuple[int, int, int]:
    import pyarrow.parquet as pq

    convert, columns = _prepared(json.dumps(task.calibration))
    wanted = schema(task.product).with_metadata({f"inclinometry.{k}": v for k, v in task.footer.items()})
    angles = [np.empty(BATCH, dtype=np.float32) for _ in range(3)]
    samples = rows = 0
    make = _windows(task.window_ns) if task.product == "windows" else _angles
    with store.reading(task.raw) as stream:
        # page checksums: without them a flipped bit is read as a number
        source = pq.ParquetFile(stream, buffer_size=1 << 20, pre_buffer=False, page_checksum_verification=True)
        with store.staged(task.target.rpartition("/")[0]) as (scratch, publish):
            with pq.ParquetWriter(scratch, wanted, **encoding(wanted)) as writer:
                held: list[list[Any]] = []
                waiting = 0
                pieces = source.iter_batches(batch_size=BATCH, columns=["time_ns", *columns], use_threads=False)
                for batch in pieces:
                    clock = batch.column("time_ns").to_numpy()
                    values = {name: batch.column(name).to_numpy() for name in columns}
                    made = make(clock, *convert(values), angles)
                    samples += len(clock)
                    waiting, rows = waiting + len(made[0]), rows + len(made[0])
                    held.append(made)
                    if waiting >= ROW_GROUP:
                        held, waiting = _flushed(writer, held, wanted), 0
                if (rest := make(None, [], None, angles)) is not None:
                    held.append(rest)
                    rows += len(rest[0])
                if held:
                    _flushed(writer, held, wanted)
            size = scratch.stat().st_size
            publish(task.target)
    return rows, size, samples


def _flushed(writer: Any, held: list[list[Any]], schema: Any) -> list[list[Any]]:
    import pyarrow as pa

    columns = [np.concatenate(parts) for parts in zip(*held, strict=True)]
    arrays = [pa.array(c, f.type) for c, f in zip(columns, schema, strict=True)]
    writer.write_table(pa.Table.from_arrays(arrays, schema=schema), row_group_size=ROW_GROUP)
    return []


Convert = Callable[[Mapping[str, Array]], tuple[list[Array], Array]]


@lru_cache(maxsize=64)
def _prepared(content: str) -> tuple[Convert, list[str]]:
    """`converter` of a tool.json, which takes longer to check than a million samples to convert."""
    return converter(calibration_from(json.loads(content), "the calibration").tool)


def converter(tool: Tool) -> tuple[Convert, list[str]]:
    """What turns columns into six channels and 24 coefficients, and the columns it needs.

    Triads of three sensors that do not know temperature go through as they are stored; of others the fields are worked
    out first.

    Raises
    ------
    InputError
        A tool without accelerometers and magnetometers that see three components each.
    """
    triads = [tool.triads.get(kind) for kind in KINDS]
    if any(triad is None or not triad.full for triad in triads):
        raise InputError("angles need accelerometers and magnetometers that see three components each")
    found = [triad for triad in triads if triad is not None]
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
