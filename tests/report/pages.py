"""What every page must be: balanced, self-contained, its ids unique."""

from __future__ import annotations

import re
from html.parser import HTMLParser

VOID = {"meta", "br", "hr", "img", "input", "link", "path", "use"}
LOADING = {"src", "href", "xlink:href", "srcset", "action", "data", "poster", "formaction", "background"}


class Page(HTMLParser):
    """Reads a page and keeps what the tests ask for."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.ids, self.references, self.tags, self.words = [], [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self._note(tag, attrs)
        if tag not in {"meta", "br", "hr", "img", "input", "link"}:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self._note(tag, attrs)

    def _note(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in LOADING:
                self.references.append(value)
            assert not name.startswith("on"), f"a script in {tag}"

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join("".join(self.words).split())


def check(text):
    """Assert what holds for every report; return the page for more."""
    page = Page(text)
    assert page.open == []
    assert text.startswith("<!doctype html>")
    assert len(page.ids) == len(set(page.ids))
    assert not {"link", "img", "iframe", "object", "embed"} & set(page.tags)
    assert all(value.startswith(("#", "data:")) for value in page.references)
    # an address may stand in a page only as the name of a namespace
    assert re.findall(r"https?://", re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)) == []
    assert "@import" not in text
    assert "mathdefault" not in text  # a tick label meant for the mathematical typesetter
    assert all(value.startswith("#") for value in re.findall(r"url\(([^)]*)\)", text))
    inner = set(re.findall(r'(?:url\(|href=")#([^)"]+)', text))
    assert inner <= set(page.ids)
    # the sentinel colours of drawings never reach a reader
    assert "#010203" not in "".join(re.findall(r"<[^>]*>", text))
    return page
