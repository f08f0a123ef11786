"""Logging in and one's own account in a real browser, which says of a form where it comes from."""

from __future__ import annotations

import time

import pytest

from inclinometry.laboratory.ledger.second_factor import code, secret_bytes

from .browser.chromium import MISSING, chromium
from .conftest import PASSWORD, serving

pytestmark = [pytest.mark.long, pytest.mark.skipif(bool(MISSING), reason=MISSING)]


def test_a_user_logs_in_and_sets_up_a_second_factor(tmp_path):
    with serving(tmp_path, "users") as server, chromium(server.url) as browser:
        driver = browser.driver

        def log_in(**fields):
            driver.get(f"{server.url}/login")
            for name, text in fields.items():
                driver.find_element("name", name).send_keys(text)
            driver.find_element("css selector", "button").click()

        log_in(name="operator", password="wrong")
        browser.wait(lambda: "Name or password is wrong" in driver.page_source, "a wrong password is not told")
        log_in(name="operator", password=PASSWORD)
        browser.wait(lambda: driver.current_url == f"{server.url}/", "nobody is logged in")
        browser.open("/account")
        secret = secret_bytes(browser.named("secret").text)
        fields = browser.find("input")
        first = next(one for one in fields if one.get_attribute("autocomplete") == "one-time-code")
        again = [one for one in fields if one.get_attribute("autocomplete") == "current-password"][-1]
        first.send_keys(code(secret, int(time.time()) // 30))
        again.send_keys(PASSWORD)
        browser.push("set-up-factor")
        browser.wait(lambda: len(browser.find("[data-testid=recovery]")) == 10, "no recovery codes")
        recovery, another = (one.text for one in browser.find("[data-testid=recovery]")[:2])
        driver.get(f"{server.url}/logout")
        log_in(name="operator", password=PASSWORD)
        browser.wait(lambda: "second factor is missing" in driver.page_source, "no code is asked for")
        log_in(name="operator", password=PASSWORD, code=recovery)
        browser.wait(lambda: driver.current_url == f"{server.url}/", "nobody is logged in")
        # the password alone does not remove it, and no code does so twice
        for given, gone in (("", False), (recovery, False), (another, True)):
            browser.open("/account")
            fields = browser.find("input")
            now = next(one for one in fields if one.get_attribute("autocomplete") == "one-time-code")
            again = [one for one in fields if one.get_attribute("autocomplete") == "current-password"][-1]
            now.send_keys(given)
            again.send_keys(PASSWORD)
            browser.push("remove-factor")
            if gone:
                browser.wait(lambda: browser.find("[data-testid=secret]"), "it is still there")
            else:
                browser.wait(lambda: "missing: code of the second factor" in driver.page_source, "nothing is said")
        assert not browser.strangers()
