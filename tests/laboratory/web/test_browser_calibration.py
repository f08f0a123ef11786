"""One whole calibration in a real Chromium, from an empty ledger to a certificate, by keyboard, through real TCP."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import etree
from selenium.webdriver.common.keys import Keys

from inclinometry.laboratory.certificate.record import record_digest
from inclinometry.laboratory.certificate.signing import unsigned
from inclinometry.laboratory.certificates import documents, status, verify_certificate
from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.ledger.verify import verify

from ..certificate.certificates import dcc_schema
from .browser.chromium import MISSING, Browser, chromium
from .browser.stand import Stand, standing_ready
from .browser.steps import begin, captured, download, finish, issue, judge, open_rolls, register

pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)

MISREAD = 5
"""Position at which the dial of the toolface is misread by two degrees."""


@pytest.mark.long
def test_from_an_empty_ledger_to_a_certificate(tmp_path):
    downloads = tmp_path / "downloads"
    downloads.mkdir()
    # the rig stands at position 1 already: the first turn is to position 2
    with standing_ready(tmp_path, misread=(MISREAD - 1, 2.0)) as stand:
        with chromium(stand.url) as browser:
            register(browser)
            begin(browser)
            capture(browser, 6)
            lose_the_instrument(browser, stand)
            capture(browser, 2)
            checked(browser)
        with chromium(stand.url, downloads=downloads) as browser:
            resume(browser)
            capture(browser, 4)
            retake_the_outlier(browser)
            finish(browser)
            verify_by_rolls(browser)
            number = issue(browser)
            papers = download(browser, downloads)
            checked(browser)
        stand.process.terminate()
        stand.process.wait(20)
        assert "Traceback" not in stand.log.read_text()
    about_the_ledger(stand, number, papers)
    about_the_papers(papers)


def capture(browser: Browser, number: int) -> None:
    """So many positions, with the space bar alone."""
    browser.wait(lambda: captured(browser) >= 0, "no progress")
    first = captured(browser)
    for more in range(1, number + 1):
        press(browser, lambda more=more: captured(browser) == first + more)


def press(browser: Browser, done: Callable[[], bool], ready: tuple[str, ...] = ("still", "learning")) -> None:
    """Space, whenever the page says that the rig can be turned or the tool stands still, until `done`."""
    last = 0.0

    def step() -> bool:
        nonlocal last
        if done():
            return True
        doing, seen = browser.state("capture"), browser.state("verdict")
        can = doing == "turn" or (doing == "capture" and seen in ready)
        if can and time.monotonic() - last > 0.5:
            last = time.monotonic()
            browser.press(Keys.SPACE)
        return False

    browser.wait(step, "nothing is captured")


def lose_the_instrument(browser: Browser, stand: Stand) -> None:
    """A pulled cable is seen, nothing is captured meanwhile, and it comes back by itself."""
    before = captured(browser)
    stand.cable.pull()
    browser.wait(lambda: browser.state("verdict") == "disconnected", "a pulled cable is not shown")
    said = "return [...document.querySelectorAll('.q-notification')].map(e => e.innerText).join()"
    press(browser, lambda: "not connected" in browser.script(said), ready=("disconnected",))
    assert captured(browser) == before
    stand.cable.plug()
    browser.wait(lambda: browser.state("verdict") in ("learning", "still"), "the instrument does not come back")
    browser.click("OK")


def resume(browser: Browser) -> None:
    """Another browser, with nothing of the first: from the first page to the position that was next."""
    browser.open("/")
    browser.click("Resume")
    browser.wait(lambda: captured(browser) == 8, "not where the other one ended")
    states = [browser.state(f"position-{number}") for number in range(1, 13)]
    assert [s == "open" for s in states] == [number > 8 for number in range(1, 13)], states
    assert browser.text("position-name") == "Position 9 of 12"


def retake_the_outlier(browser: Browser) -> None:
    """The page names the misread dial; with arrows and space the position is taken again, and nothing is an outlier."""
    named = "the dial seems misread (toolface)"
    browser.wait(lambda: named in browser.text(f"outlier-{MISREAD}"), "no position is named")
    assert [n for n in range(1, 13) if browser.state(f"position-{n}") == "outlier"] == [MISREAD]
    back_to(browser, MISREAD)
    press(browser, lambda: "attempt 2" in browser.text("position-state"))
    browser.wait(lambda: browser.state(f"position-{MISREAD}") == "done", "still an outlier")
    browser.wait(lambda: not browser.find('[data-testid^="outlier-"]'), "something is an outlier")


def back_to(browser: Browser, number: int) -> None:
    """With the left arrow; the page takes no key while it is at work on the last reading."""
    for _ in range(40):
        before = browser.text("position-name")
        if before == f"Position {number} of 12":
            return
        browser.press(Keys.ARROW_LEFT)
        end = time.monotonic() + 0.7
        while browser.text("position-name") == before and time.monotonic() < end:
            time.sleep(0.02)
    raise AssertionError(browser.text("position-name"))


def verify_by_rolls(browser: Browser) -> None:
    """Four rolls the calibration has not seen, by keyboard, and the verdict."""
    open_rolls(browser)
    capture(browser, 4)
    judge(browser)


def checked(browser: Browser) -> None:
    """Nothing was asked of another machine, no page complained."""
    browser.drain()
    assert len(browser.requested) > 20
    assert not browser.strangers()
    assert not browser.said


def about_the_ledger(stand: Stand, number: str, papers: dict[str, Path]) -> None:
    """Every acknowledged reading is there, the chain is sound, the documents are those of the ledger."""
    with Ledger(str(stand.ledger)) as ledger:
        assert verify(ledger).ok
        assert ledger.count("reading") == 12 + 1 + 4
        assert not verify_certificate(ledger, number)
        kept = {data for _, _, data in documents(ledger, status(ledger, number).record).values()}
        assert {path.read_bytes() for path in papers.values()} == kept


def about_the_papers(papers: dict[str, Path]) -> None:
    paper = papers[".pdf"].read_bytes()
    assert paper.startswith(b"%PDF-1.")
    pages = re.search(rb"/Type ?/Pages ?/Count (\d+)", paper)
    assert pages
    assert 2 <= int(pages[1]) <= 12
    assert record_digest(unsigned(json.loads(papers[".json"].read_text()))) in papers[".xml"].read_text()
    dcc_schema().assertValid(etree.parse(papers[".xml"]))
