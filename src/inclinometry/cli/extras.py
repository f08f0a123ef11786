"""Optional packages: which extra brings each, and what is said where one is not installed."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple


class Extra(NamedTuple):
    """What to install: the name of a package at the index, and the extra of this one that brings it."""

    package: str
    extra: str


_TABLE: Final = """
matplotlib jinja2 markupsafe:jinja2 | report
pyproj | earth
h5py lasio lxml openpyxl pyarrow | formats
nicegui fastapi:nicegui starlette:nicegui pydantic:nicegui uvicorn:nicegui multipart:python-multipart
python_multipart:python-multipart sqlalchemy alembic argon2:argon2-cffi zxcvbn serial:pyserial typst segno
cryptography pyhanko pyhanko_certvalidator:pyhanko asn1crypto:pyhanko signxml | laboratory
psycopg | postgresql
distributed dask deltalake | fleet
"""  # as imported, with the package's name where it is another; the extra `fast` (numba) is never missed, only slower


def _extras() -> dict[str, Extra]:
    found = {}
    waiting: list[str] = []
    for line in _TABLE.strip().splitlines():
        names, _, extra = line.partition(" | ")
        waiting += names.split()
        if extra:
            for module, _, package in (name.partition(":") for name in waiting):
                found[module] = Extra(package or module, extra)
            waiting = []
    return found


EXTRAS: Final[Mapping[str, Extra]] = MappingProxyType(_extras())
"""Name at an import -> what to install."""

_REPORT: Final = ("matplotlib", "jinja2")
_ENDINGS: Final = {
    ".h5": "h5py",
    ".hdf5": "h5py",
    ".xlsx": "openpyxl",
    ".xlsm": "openpyxl",
    ".parquet": "pyarrow",
    ".pq": "pyarrow",
    ".las": "lasio",
    ".witsml": "lxml",
    ".xml": "lxml",
}


def missing(error: BaseException | None) -> str | None:
    """What to install when an optional package is at the bottom of an error; None when it is something else.

    Examples
    --------
    >>> missing(ModuleNotFoundError("No module named 'serial'", name="serial.tools"))
    'this needs pyserial: pip install "inclinometry[laboratory]"'
    >>> missing(ModuleNotFoundError("No module named 'numpy'", name="numpy")) is None
    True
    """
    while error is not None:
        if isinstance(error, ModuleNotFoundError):
            found = EXTRAS.get((error.name or "").partition(".")[0])
            if found is not None:
                return f'this needs {found.package}: pip install "inclinometry[{found.extra}]"'
        # the table of commands imports on demand and wraps what an import raises
        error = error.__cause__
    return None


def need(*modules: str) -> None:
    """Fail now rather than after minutes of computing, without importing anything.

    Raises
    ------
    ModuleNotFoundError
        As the import itself would.
    """
    for module in modules:
        if find_spec(module) is None:
            raise ModuleNotFoundError(f"No module named {module!r}", name=module)


def need_for(option: str, path: Path) -> None:
    """`need` of what writing an output takes: pages by the option's name, tables by the ending of theirs."""
    if option == "--report":
        need(*_REPORT)
    elif path.suffix.lower() in _ENDINGS:
        need(_ENDINGS[path.suffix.lower()])
