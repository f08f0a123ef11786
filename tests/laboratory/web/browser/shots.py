"""Pictures of pages: `python -m tests.laboratory.web.browser.shots FOLDER [page ...]`: sizes, themes, languages."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from .chromium import Browser, chromium
from .stand import standing_ready

LOOKS = (
    ("wide-light-en", 1280, 800, "light", "en"),
    ("narrow-dark-en", 400, 800, "dark", "en"),
    ("narrow-light-ru", 400, 800, "light", "ru"),
    ("wide-dark-zh", 1280, 800, "dark", "zh"),
)


def dressed(browser: Browser, width: int, height: int, theme: str, language: str) -> None:
    """The look of the pages opened from now on."""
    browser.size(width, height)
    browser.theme(theme)
    browser.language(language)


def main(folder: str, *names: str) -> None:
    with tempfile.TemporaryDirectory() as where, standing_ready(Path(where), rate=10, seconds=2, furnished=True) as s:
        with chromium(s.url) as browser:
            for look, *how in LOOKS:
                dressed(browser, *how)
                for name in names or s.pages:
                    browser.open(s.pages[name])
                    time.sleep(1.5)
                    browser.picture(Path(folder) / f"{name}-{look}.png")
                    print(f"{name:13} {look:16} shifted {browser.shifted():.4f}  too wide by {browser.too_wide()} px")
            browser.drain()
            print(sorted(set(browser.said)), browser.strangers())
        s.process.terminate()
        s.process.wait(10)
        print(s.log.read_text())


if __name__ == "__main__":
    main(*sys.argv[1:])
