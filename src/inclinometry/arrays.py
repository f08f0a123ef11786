"""The one gate for shape and finiteness: public functions pass their arrays through here, kernels do not check."""

from __future__ import annotations

import copyreg
import reprlib
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inclinometry.errors import out_of_order, out_of_range, refused, wrong_kind, wrong_shape

Array: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]


def finite(value: ArrayLike, name: str, shape: tuple[int | None, ...] | None = None) -> Array:
    """`value` as a float64 array of the given trailing shape (None: any length), every element finite."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise wrong_kind(name, reprlib.repr(value), "array of numbers") from None
    if shape is not None:
        trailing = array.shape[max(array.ndim - len(shape), 0) :]
        fits = len(trailing) == len(shape) and all(
            want is None or want == have for want, have in zip(shape, trailing, strict=True)
        )
        if not fits:
            wanted = ", ".join("any" if n is None else str(n) for n in shape)
            raise wrong_shape(name, array.shape, f"(..., {wanted})")
    good = np.isfinite(array)
    if not good.all():
        where = tuple(int(i) for i in np.argwhere(~good)[0])
        at = f"[{', '.join(map(str, where))}]" if where else ""
        raise refused("input-finite", {"name": f"{name}{at}"})
    return array


def within(value: ArrayLike, name: str, low: float, high: float, unit: str = "") -> Array:
    """Return `value` as finite float64, every element in [low, high].

    Examples
    --------
    >>> within(0.3, "dip", -1.6, 1.6, "rad")
    array(0.3)
    """
    array = finite(value, name)
    bad = (array < low) | (array > high)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        at = f"[{', '.join(map(str, where))}]" if where else ""
        allowed = f"{low:g} .. {high:g}" if high < np.inf else f">= {low:g}"
        raise out_of_range(f"{name}{at}", float(array[where]), f"{allowed} {unit}".rstrip())
    return array


def bottom_up(depth: Array) -> bool:
    """Whether depths fall from each to the next."""
    return len(depth) > 1 and bool((np.diff(depth) < 0.0).all())


def increasing(values: Array, name: str) -> None:
    """InputError where finite values (n,) do not strictly increase."""
    back = np.flatnonzero(np.diff(values) <= 0.0)
    if back.size:
        before, value = values[back[0] : back[0] + 2].tolist()
        raise out_of_order(name, value, before, int(back[0]) + 2)


def not_degrees(value: ArrayLike, name: str) -> Array:
    """`value`, an inclination or dip in rad, as finite float64; more than two turns are refused as degrees."""
    array = finite(value, name)
    largest = np.abs(array).max(initial=0.0)
    if largest > 4.0 * np.pi:
        raise out_of_range(name, float(largest), "-4 pi .. 4 pi rad")
    return array


def frozen(value: Any) -> Array:
    """Return a read-only float64 copy, for the fields of frozen results."""
    array = np.array(value, dtype=np.float64)
    array.flags.writeable = False
    return array


def read_only(value: Any) -> Any:
    """The same array made read-only; anything else as it is."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    return value


def is_read_only(value: object) -> bool:
    """Whether `value` is an array that cannot be written to."""
    return isinstance(value, np.ndarray) and not value.flags.writeable


def _mapping(content: dict[Any, Any], names: frozenset[Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType({name: read_only(value) if name in names else value for name, value in content.items()})


def _reduced(mapping: MappingProxyType[Any, Any]) -> tuple[Any, ...]:
    # a copy of an array is writable: which ones were not goes along
    return _mapping, (dict(mapping), frozenset(name for name, value in mapping.items() if is_read_only(value)))


# the mappings of frozen results: Python itself can neither pickle nor copy them. It stands here because every result
# comes from a module that imports this one
copyreg.pickle(MappingProxyType, _reduced)
