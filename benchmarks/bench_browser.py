"""The bench in a real Chromium: from an empty folder to a certificate as the README says it, and five browsers at once.

    python -m benchmarks.bench_browser [--json] [--browsers 5] [--seconds 10]

The newcomer's time is that of the whole way of README.md with the program's own settings: registering, twelve positions
of a simulated instrument captured by themselves, result, four rolls, certificate; typing is by program, reading
is not. For the load as many browsers, each a process of its own, look at one live page; counted are the updates that
reached each page. CPU time is that of the server's process with its simulated instrument, of one core.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from selenium.webdriver.common.keys import Keys
from tests.laboratory.web.browser.chromium import MISSING, Browser, chromium
from tests.laboratory.web.browser.steps import (
    begin,
    captured,
    download,
    finish,
    issue,
    judge,
    open_rolls,
    register,
)

from benchmarks import command
from benchmarks.measure import cpu_time, served

WANTED = {"newcomer_s": 600.0, "first_page_s": 1.5, "updates_per_second": 9.0}
LIVE = ("still", "learning", "few", "turn")
"""Words of a page whose numbers come in."""
COUNT = "window.told = 0; const put = window.benchLive; window.benchLive = said => { window.told += 1; put(said); };"


def newcomer() -> dict[str, float]:
    """Seconds of each step of the README's way."""
    times: dict[str, float] = {}
    began = time.perf_counter()

    def done(name: str) -> None:
        times[name] = time.perf_counter() - began - sum(times.values())

    with tempfile.TemporaryDirectory() as where, served(Path(where), "--instrument", "simulated") as (url, _):
        done("start the bench")
        downloads = Path(where) / "downloads"
        downloads.mkdir()
        with chromium(url, downloads=downloads) as browser:
            browser.open("/")
            painted = browser.script("return window.painted")["first-contentful-paint"] / 1000.0
            done("start the browser")
            register(browser)
            begin(browser)
            done("tool, rig, plan")
            _by_itself(browser, 12)
            done("twelve positions")
            finish(browser)
            open_rolls(browser)
            _by_itself(browser, 4)
            judge(browser)
            done("result and verification")
            issue(browser)
            download(browser, downloads)
            done("certificate")
    return {**times, "whole way": time.perf_counter() - began, "first page painted": painted}


def _by_itself(browser: Browser, number: int) -> None:
    """Press A and wait."""
    browser.wait(lambda: browser.state("verdict") in LIVE, "no live data", 20.0)
    browser.press("a")
    browser.wait(lambda: captured(browser) == number, f"{number} positions are not captured", 30.0 * number)


def load(browsers: int, seconds: float) -> dict[str, Any]:
    """Updates a second that reach each of several browsers, and what the server's process takes."""
    with ExitStack() as stack:
        where = stack.enter_context(tempfile.TemporaryDirectory())
        url, process = stack.enter_context(served(Path(where), "--demo"))
        pages = [stack.enter_context(chromium(url)) for _ in range(browsers)]
        for page in pages:
            page.open("/")
            page.click("Resume")
            page.named("capture")
            page.press(Keys.TAB)
            page.wait(lambda page=page: page.state("verdict") in LIVE, "no live data", 20.0)
            page.script(COUNT)
        before, begin_cpu, starts = time.perf_counter(), cpu_time(process), [_told(page) for page in pages]
        time.sleep(seconds)
        ends, end_cpu, after = [_told(page) for page in pages], cpu_time(process), time.perf_counter()
        rates = [(e[0] - s[0]) / (e[1] - s[1]) for s, e in zip(starts, ends, strict=True)]
    return {
        "browsers": browsers,
        "updates_per_second": rates,
        "share_of_a_core": (end_cpu - begin_cpu) / (after - before),
    }


def _told(page: Browser) -> tuple[int, float]:
    """Updates so far, and the page's own clock, s."""
    told, now = page.script("return [window.told, performance.now()]")
    return int(told), float(now) / 1000.0


def run(browsers: int = 5, seconds: float = 10.0) -> dict[str, Any]:
    """Both measurements."""
    if MISSING:
        raise SystemExit(MISSING)
    return {"cores": os.cpu_count(), "newcomer_s": newcomer(), "load": load(browsers, seconds), "wanted": WANTED}


def report(found: dict[str, Any]) -> None:
    """Print the figures."""
    print("from an empty folder to a certificate, seconds:")
    for name, value in found["newcomer_s"].items():
        print(f"  {name:26}{value:8.1f}")
    load = found["load"]
    rates = ", ".join(f"{rate:.1f}" for rate in load["updates_per_second"])
    print(f"{load['browsers']} browsers on {found['cores']} cores, updates a second in each: {rates}")
    print(f"server's process, of one core: {100.0 * load['share_of_a_core']:.0f} %")


if __name__ == "__main__":
    command(__doc__, run, report)
