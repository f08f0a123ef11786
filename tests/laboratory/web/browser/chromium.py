"""A real Chromium without a screen, driven through Debian's chromedriver; nothing is ever downloaded."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException, WebDriverException
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement

BROWSER = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = os.environ.get("CHROMEDRIVER") or shutil.which("chromedriver")
MISSING = (
    "" if BROWSER and DRIVER else "no chromium and chromedriver here (Debian: apt install chromium chromium-driver)"
)
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-default-apps",
    "--disable-extensions", "--disable-dev-shm-usage", "--hide-scrollbars", "--force-color-profile=srgb",
)  # fmt: skip
INSIDE = ("data", "blob", "about", "chrome", "chrome-error", "chrome-untrusted", "devtools")
"""Schemes of addresses that are no request."""
SHIFTS = """
window.shifts = [];
new PerformanceObserver(list => { for (const e of list.getEntries())
    if (!e.hadRecentInput) window.shifts.push([e.startTime, e.value,
        (e.sources || []).map(s => s.node ? (s.node.className || s.node.nodeName) : '').join(' | ')]);
}).observe({type: 'layout-shift', buffered: true});
"""


class Browser:
    """One browser with a profile of its own, and what it asked for.

    requested : every address it has requested, in order; read by `drain`.
    said : what pages wrote to the console as warnings or errors.
    """

    def __init__(self, driver: webdriver.Chrome, base: str) -> None:
        self.driver, self.base = driver, base
        self.requested: list[str] = []
        self.said: list[str] = []

    def open(self, path: str) -> None:
        self.driver.get(self.base + path if path.startswith("/") else path)
        self.wait(lambda: self.script("return !!window.socket && window.socket.connected"), "the page is not connected")

    def script(self, text: str, *args: Any) -> Any:
        return self.driver.execute_script(text, *args)

    def at(self, path: str) -> bool:
        return urlsplit(self.driver.current_url).path.startswith(path)

    def find(self, css: str) -> list[WebElement]:
        return self.driver.find_elements(By.CSS_SELECTOR, css)

    def one(self, css: str, seconds: float = 60.0) -> WebElement:
        return self.wait(lambda: next(iter(self.find(css)), None), f"there is no {css}", seconds)

    def named(self, name: str) -> WebElement:
        """What a test id names."""
        return self.one(f'[data-testid="{name}"]')

    def push(self, name: str) -> None:
        """The button of a test id, once nothing that still moves covers it."""
        self.wait(lambda: self.named(name).click() or True, f"{name!r} cannot be pushed")

    def text(self, name: str) -> str:
        """Text of what a test id names; empty where there is none."""
        found = self.find(f'[data-testid="{name}"]')
        try:
            return found[0].text if found else ""
        except StaleElementReferenceException:
            return ""

    def state(self, name: str) -> str:
        found = self.find(f'[data-testid="{name}"]')
        try:
            return (found[0].get_attribute("data-state") or "") if found else ""
        except StaleElementReferenceException:
            return ""

    def wait(self, found: Callable[[], Any], what: str, seconds: float = 180.0) -> Any:
        """What `found` gives once it gives something."""
        end = time.monotonic() + seconds
        while True:
            try:
                value = found()
            except WebDriverException:
                value = None
            if value:
                return value
            if time.monotonic() > end:
                raise AssertionError(f"{what}; at {self.driver.current_url}:\n{self.seen()}")
            time.sleep(0.03)

    def seen(self) -> str:
        """All words of the page."""
        return str(self.script("return document.body.innerText"))

    def press(self, *keys: str) -> None:
        """Keys, to whatever has the focus."""
        webdriver.ActionChains(self.driver, duration=10).send_keys(*keys).perform()

    def fill(self, label: str, text: str, *, choose: bool = False) -> None:
        """Write into the field of a label; `choose` ends it with Enter, as a list of choices wants."""
        css = f'input[aria-label="{label}"], textarea[aria-label="{label}"]'
        # a field to search by stands above the form; one that a choice shows comes a moment later
        self.wait(lambda: self.find(css)[-1].click() or True if self.find(css) else None, f"no field {label!r}")
        field = self.find(css)[-1]
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text)
        if choose:
            time.sleep(0.15)
            field.send_keys(Keys.ENTER)
        field.send_keys(Keys.TAB)

    def pick(self, label: str, words: str) -> None:
        """Choose the entry with these words from the list of a label."""
        self.one(f'[aria-label="{label}"]').click()
        self.wait(lambda: self._entry(words), f"the list {label!r} has no {words!r}").click()
        self.wait(lambda: not self.find(".q-menu"), "the list does not close")

    def _entry(self, words: str) -> WebElement | None:
        return next((e for e in self.find(".q-menu .q-item") if words in e.text), None)

    def click(self, words: str) -> None:
        """A button or link by its words."""
        texts = "//button[normalize-space()=$w] | //a[normalize-space()=$w]".replace("$w", json.dumps(words))
        self.wait(
            lambda: next((e for e in self.driver.find_elements(By.XPATH, texts) if e.is_enabled()), None),
            f"there is no {words!r}",
        ).click()

    def size(self, width: int, height: int) -> None:
        """Of the page itself, whatever the window adds."""
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
        )

    def theme(self, name: str) -> None:
        """light or dark, as its user has set it."""
        self.cookie("inclinometry_theme", name)

    def language(self, code: str) -> None:
        self.cookie("inclinometry_language", code)

    def cookie(self, name: str, value: str) -> None:
        self.driver.execute_cdp_cmd("Network.setCookie", {"name": name, "value": value, "url": self.base})

    def picture(self, path: Path, *, whole: bool = True) -> None:
        """A screenshot, of the whole page or of what is in the window."""
        import base64

        path.parent.mkdir(parents=True, exist_ok=True)
        wish = {"format": "png", "captureBeyondViewport": whole}
        if whole:
            width, height = self.script("return [innerWidth, document.documentElement.scrollHeight]")
            wish["clip"] = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
        path.write_bytes(base64.b64decode(self.driver.execute_cdp_cmd("Page.captureScreenshot", wish)["data"]))

    def shifted(self) -> float:
        """How much of the page has jumped since it was opened, as the sum of its layout shifts."""
        return float(sum(value for _, value, _ in self.script("return window.shifts")))

    def too_wide(self) -> int:
        """Pixels by which the page is wider than its window."""
        return int(self.script("return document.scrollingElement.scrollWidth - innerWidth"))

    def drain(self) -> None:
        """Take over what was requested and said since the last time."""
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                self.requested.append(message["params"]["request"]["url"])
            elif message["method"] == "Network.webSocketCreated":
                self.requested.append(message["params"]["url"])
        for entry in self.driver.get_log("browser"):
            if entry["level"] in ("SEVERE", "WARNING"):
                self.said.append(entry["message"])

    def strangers(self) -> list[str]:
        """Addresses requested from anywhere but the server."""
        own = urlsplit(self.base).netloc
        return [u for u in self.requested if urlsplit(u).scheme not in INSIDE and urlsplit(u).netloc != own]


@contextmanager
def chromium(base: str, *, width: int = 1280, height: int = 800, downloads: Path | None = None) -> Iterator[Browser]:
    """A browser with a fresh profile, for the server at `base`; it is ended, and its profile removed."""
    assert BROWSER, MISSING
    assert DRIVER, MISSING
    with tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True) as profile:
        options = webdriver.ChromeOptions()
        options.binary_location = BROWSER
        for flag in (*FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
        wishes = {"intl.accept_languages": "en", "plugins.always_open_pdf_externally": True}
        if downloads is not None:
            wishes["download.default_directory"] = str(downloads)
        options.add_experimental_option("prefs", wishes)
        service = webdriver.ChromeService(executable_path=DRIVER, env={**os.environ, "SE_OFFLINE": "true"})
        driver = webdriver.Chrome(options=options, service=service)
        try:
            browser = Browser(driver, base)
            driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": SHIFTS})
            browser.size(width, height)
            yield browser
        finally:
            driver.quit()
