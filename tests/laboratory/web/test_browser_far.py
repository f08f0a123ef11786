"""The page while the tool is far from the target: a red word with the sizes, no capture without a reason."""

from __future__ import annotations

import time

import pytest
from selenium.webdriver.common.keys import Keys

from inclinometry.laboratory.ledger.ledger import Ledger

from .browser.chromium import MISSING, chromium
from .browser.stand import standing_ready
from .browser.steps import captured

pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)


@pytest.mark.long
def test_a_tool_that_is_not_at_its_target_is_shown_in_red_and_captured_with_a_reason_only(tmp_path):
    """The stand says it is at position 13; the tool is 40 deg from there, by its calibration of before."""
    with standing_ready(tmp_path, rate=20.0, seconds=1.0, furnished=True, misread=(1, 40.0)) as stand:
        with chromium(stand.url, width=1440, height=900) as browser:
            browser.open(stand.pages["bench"])
            browser.wait(lambda: captured(browser) == 12, "no session")
            browser.wait(lambda: browser.text("judged-by"), "no calibration tells the angles")
            browser.wait(lambda: browser.state("capture") == "turn", "the rig is there already")
            browser.press("a")
            browser.wait(lambda: browser.state("verdict") == "far", "nothing is said of the wrong position")
            word = browser.one("#live-word")
            assert (word.text, "bad" in word.get_attribute("class")) == ("Not at the target", True)
            said = browser.one("#live-advice").text
            assert said.startswith("Toolface ")
            assert " deg, target " in said
            assert "far" in browser.one("#off-toolface").get_attribute("class")
            time.sleep(3.0)
            assert captured(browser) == 12, "captured by itself"

            def asked() -> bool:
                if "give the reason" in browser.seen():
                    return True
                browser.press(Keys.SPACE)  # again where the samples had stopped for a moment
                time.sleep(1.0)
                return False

            browser.wait(asked, "no reason is asked for")
            browser.push("confirm")
            assert captured(browser) == 12, "captured without a reason"
            browser.named("reason").send_keys("the index mark is on the other side", Keys.ENTER)
            browser.wait(lambda: captured(browser) == 13, "not captured with a reason")
            assert browser.strangers() == []
        with Ledger(str(stand.ledger)) as ledger:
            note = ledger.find("reading", newest=True, limit=1)[0].body["note"]
    assert "toolface" in note
    assert note.endswith(": the index mark is on the other side")
