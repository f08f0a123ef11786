"""What a technician does on the pages, step by step, by the words that are on them."""

from __future__ import annotations

import re
from pathlib import Path

from .chromium import Browser

SERIAL, RIG = "IN-7", "stand 1"


def register(browser: Browser) -> None:
    """A tool, in a ledger that has nothing."""
    browser.open("/tools")
    browser.fill("Serial number", SERIAL)
    browser.fill("Name", "Steering tool")
    browser.fill("Customer", "Drilling company")
    browser.click("Save")
    browser.wait(lambda: browser.at(f"/tools/{SERIAL}"), "the tool is not registered")


def begin(browser: Browser) -> None:
    """A session of twelve positions on a rig that is named for the first time."""
    browser.click("Start a calibration")
    browser.wait(lambda: browser.at("/calibrate"), "no form")
    browser.fill("Rig", RIG, choose=True)
    browser.fill("Dip of the magnetic field at the stand, degrees (blank: not known)", "70")
    browser.pick("Plan", "Twelve positions")
    browser.click("Begin")
    browser.named("capture")


def captured(browser: Browser) -> int:
    """How many positions, as the page says."""
    words = re.search(r"(\d+) of \d+ positions", browser.text("progress"))
    return int(words[1]) if words else -1


def finish(browser: Browser) -> None:
    browser.push("finish")
    browser.wait(lambda: browser.at("/results/"), "no result")
    browser.wait(lambda: "Parameters" in browser.seen(), "no parameters")
    assert SERIAL in browser.seen()
    assert "sign of the magnetic field" not in browser.seen()  # its dip was stated as the session began


def open_rolls(browser: Browser) -> None:
    """A verification of the calibration that is shown, at four rolls."""
    browser.click("Verify it")
    browser.wait(lambda: browser.at("/verify"), "no form")
    browser.pick("Positions", "four toolfaces")
    browser.click("Open the session")
    browser.named("capture")


def judge(browser: Browser) -> None:
    """The verdict on what was captured."""
    browser.push("finish")
    browser.click("Record this verdict")
    browser.wait(lambda: browser.at("/verifications/"), "no verdict was recorded")
    assert "AGREES WITH THE CERTIFICATE" in browser.seen()


def issue(browser: Browser) -> str:
    """The certificate's number."""
    browser.click("Issue a certificate")
    browser.wait(lambda: browser.at("/certificates/new"), "no form")
    browser.fill("Name", "Borehole Metrology Laboratory")
    browser.fill("Address", "Example street 1, 12345 Town")
    browser.fill("Country (two letters, e.g. DE)", "NO")
    if "Resolve these warnings before issuing" in browser.seen():
        browser.fill("Reason to accept them (printed on the certificate)", "the field points down")
    browser.click("Issue")
    browser.wait(lambda: re.search(r"/certificates/\d{4}-\d+$", browser.driver.current_url), "none was issued")
    assert "issued" in browser.seen()
    return browser.driver.current_url.rpartition("/")[2]


def download(browser: Browser, folder: Path) -> dict[str, Path]:
    """The three documents, by their ending."""
    for words in ("Certificate (PDF/A)", "Digital calibration certificate (DCC, XML)", "Record (for programs)"):
        browser.click(words)

    def all_there() -> dict[str, Path] | None:
        found = {path.suffix: path for path in folder.iterdir() if path.suffix in (".pdf", ".xml", ".json")}
        return found if len(found) == 3 else None

    return browser.wait(all_there, "the documents do not come")
