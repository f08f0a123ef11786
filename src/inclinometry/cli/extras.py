"""Optional packages: which extra brings each, and what is said where one is not installed."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Final

_TABLE: Final = {
    "report": "matplotlib jinja2 markupsafe:jinja2",
    "earth": "pyproj",
    "formats": "h5py lasio lxml openpyxl pyarrow xlrd",
    "laboratory": "nicegui fastapi:nicegui starlette:nicegui pydantic:nicegui uvicorn:nicegui "
    "multipart:python-multipart python_multipart:python-multipart sqlalchemy alembic annotated_types:annotated-types "
    "argon2:argon2-cffi zxcvbn serial:pyserial typst segno cryptography pyhanko pyhanko_certvalidator:pyhanko "
    "asn1crypto:pyhanko signxml",
    "postgresql": "psycopg",
    "fleet": "distributed dask deltalake",
}
"""Extra -> its packages as imported, with their names where those are others; `fast` (numba) is only slower without."""
EXTRAS: Final = {
    module: (package or module, extra)
    for extra, names in _TABLE.items()
    for module, _, package in (name.partition(":") for name in names.split())
}
"""Name at an import -> name of the package, and the extra that brings it."""


def missing(error: BaseException | None) -> tuple[str, str] | None:
    """The optional package that is the cause of an error, and its extra; None for any other error."""
    while error is not None:
        if isinstance(error, ModuleNotFoundError):
            found = EXTRAS.get((error.name or "").partition(".")[0])
            if found is not None:
                return found
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
    endings = {"h5py": ".h5 .hdf5", "openpyxl": ".xlsx .xlsm", "pyarrow": ".parquet .pq", "lasio": ".las"}
    endings["lxml"] = ".witsml .xml"
    if option == "--report":
        need("matplotlib", "jinja2")
    else:
        need(*(module for module, known in endings.items() if path.suffix.lower() in known.split()))
