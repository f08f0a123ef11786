"""Check the built pages: every link, image and anchor inside them leads somewhere.

    python docs/check_links.py docs/_build/html

Links to other sites are not followed, as nothing here uses a network: only their form is checked, and they are listed.
Files of the repository named in the text (`tests/...`, `docs/...`) must exist.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

REPOSITORY = Path(__file__).resolve().parent.parent
_FILE = re.compile(r"(?:src|tests|docs|benchmarks)/[\w./-]+\.\w+")
_BUILT = ("docs/_build", "docs/gallery")


@dataclass
class Page(HTMLParser):
    """What one page links to, and what can be linked to in it."""

    path: Path
    links: list[str] = field(default_factory=list)
    anchors: set[str] = field(default_factory=set)
    files: set[str] = field(default_factory=set)
    code: bool = False

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Links, sources and anchors."""
        self.code = self.code or tag == "code"
        for name, value in attrs:
            if value is None:
                continue
            if name in ("href", "src"):
                self.links.append(value)
            elif name == "srcset":
                self.links += [part.split()[0] for part in value.split(",")]
            elif name == "id" or (name == "name" and tag == "a"):
                self.anchors.add(value)

    def handle_endtag(self, tag: str) -> None:
        """The end of a code span."""
        self.code = self.code and tag != "code"

    def handle_data(self, data: str) -> None:
        """Files of the repository named in code spans."""
        if self.code and _FILE.fullmatch(data.strip()):
            self.files.add(data.strip())


def problem_of(link: str, page: Page, pages: dict[Path, Page]) -> str | None:
    """Why an internal link leads nowhere, or None."""
    parts = urlsplit(link)
    target = (page.path.parent / unquote(parts.path)).resolve() if parts.path else page.path
    if target.is_dir():
        target = target / "index.html"
    if not target.exists():
        return f"{link}: no such file"
    if parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
        return f"{link}: no such anchor"
    return None


def check(folder: Path) -> tuple[list[str], list[str], int]:
    """Problems, external links and the number of internal links of a built documentation."""
    pages = {path.resolve(): Page(path.resolve()) for path in sorted(folder.rglob("*.html"))}
    problems: list[str] = []
    external: set[str] = set()
    count = 0
    for path, page in pages.items():
        name = path.relative_to(folder.resolve())
        for link in dict.fromkeys(page.links):
            scheme = urlsplit(link).scheme
            if scheme in ("http", "https"):
                external.add(link)
                if not urlsplit(link).hostname:
                    problems.append(f"{name}: {link}: no host")
            elif scheme not in ("data", "mailto", "javascript"):
                count += 1
                found = problem_of(link, page, pages)
                if found:
                    problems.append(f"{name}: {found}")
        for file in sorted(page.files):
            if not file.startswith(_BUILT) and not (REPOSITORY / file).exists():
                problems.append(f"{name}: names {file}, which is not in the repository")
    return problems, sorted(external), count


def main() -> int:
    """Command line; exit status 1 when a link leads nowhere."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/_build/html")
    if not (folder / "index.html").exists():
        print(f"{folder} holds no built documentation; run make docs", file=sys.stderr)
        return 2
    problems, external, count = check(folder)
    for problem in problems:
        print(problem, file=sys.stderr)
    print(f"{count} internal links checked, {len(problems)} broken; {len(external)} external links, not followed:")
    for link in external:
        print(f"  {link}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
