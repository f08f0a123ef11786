"""From an open warning to the site that resolves it: the start form, the page of the certificate, the result."""

from __future__ import annotations

import numpy as np
import pytest

from inclinometry.laboratory.ledger.ledger import Ledger
from inclinometry.laboratory.registry import RegisteredSite, put_site

from .browser.chromium import MISSING, chromium
from .browser.stand import standing_ready

pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)
GO = "Set the site and evaluate again"


@pytest.mark.long
def test_the_warning_leads_to_the_site_and_is_resolved(tmp_path):
    """The site of the furnished ledger has no dip: the form says so; `hall`, registered later, has one."""
    with standing_ready(tmp_path, rate=20.0, furnished=True) as stand, chromium(stand.url) as browser:
        browser.open("/calibrate")
        browser.wait(lambda: browser.named("no-dip").is_displayed(), "nothing is said of the dip")
        with Ledger(str(stand.ledger)) as ledger:
            put_site(ledger, RegisteredSite("hall", dip=float(np.radians(70.0))), author="anna")
        browser.open("/calibrate")
        browser.pick("Site", "hall")
        browser.wait(lambda: "Without a site or dip" not in browser.seen(), "said of a site with its dip")
        browser.open(stand.pages["issue"])
        browser.click(GO)
        browser.wait(lambda: browser.at("/results/"), "no way to the site")
        browser.pick("Site", "hall")
        browser.push("again")
        browser.wait(lambda: "No warnings" in browser.seen(), "not evaluated again")
        browser.open(stand.pages["result"])
        browser.click("These readings were evaluated again: the newest calibration")
        browser.wait(lambda: "No warnings" in browser.seen(), "no way to the newest calibration")
        assert browser.strangers() == []
