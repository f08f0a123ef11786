"""One outcome for every run: generated examples are the same ones each time, and none is hurried by a clock.

To look for new ones: pytest --hypothesis-profile=search. A failure prints the line (@reproduce_failure) that
repeats it. Linear algebra runs on one thread: the matrices are small, and threads that wait for each other on a busy
machine make a test of a second take minutes. A shell's background job ignores Ctrl-C, and so would the programs that
the tests start and interrupt.
"""

import os
import signal
import tempfile
from pathlib import Path
from types import MappingProxyType

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import pytest
from hypothesis import HealthCheck, settings

from inclinometry.findings import Finding, rule

UNHURRIED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow], "print_blob": True, "database": None}
settings.register_profile("same", derandomize=True, **UNHURRIED)
settings.register_profile("search", derandomize=False, **UNHURRIED)
settings.load_profile("same")

# rooms whose tests work the mathematics through commands, files and pages: coverage is not measured while they run,
# which would take half as long again, and is reached without them
_UNMEASURED = {"cli", "docs", "files", "fleet", "fuzz", "laboratory", "report", "workflow"}
_TOPS = (Path(__file__).parent, Path(__file__).parents[1] / "src" / "inclinometry")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    measured = getattr(item.config.pluginmanager.getplugin("_cov"), "cov_controller", None)
    rooms = {item.path.relative_to(top).parts[0] for top in _TOPS if item.path.is_relative_to(top)}
    if measured is None or not rooms & _UNMEASURED:
        return (yield)
    measured.pause()
    try:
        return (yield)
    finally:
        measured.resume()


# keys and witnesses of the ledgers that tests make: never those of who runs them
_KEYS = tempfile.TemporaryDirectory(prefix="inclinometry-keys-")
os.environ["INCLINOMETRY_KEYS"] = _KEYS.name


@pytest.fixture(autouse=True, scope="session")
def findings_are_whole():
    """Every finding that any test makes has the values of its example in the catalogue, no more and no fewer."""
    made = Finding.__new__

    def checked(cls, code, values=MappingProxyType({}), *more, **named):
        assert set(values) == set(rule(code).example), (code, sorted(set(values) ^ set(rule(code).example)))
        return made(cls, code, values, *more, **named)

    Finding.__new__ = checked
    yield
    Finding.__new__ = made
