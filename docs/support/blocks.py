"""The blocks of a page, run one after the other in a folder, and what they print put into the page.

A page has blocks of commands (sh), of Python and of files (toml, their first line `# name`; others as none, with
`--- name ---`). A block of text right
behind a block of commands or of Python is what that printed. An image of `_static/shown` is a picture that the page
has made: a file of that name in its folder, or a figure of a report, `gyro-azimuth.svg` being the first of gyro.html
whose caption begins so. What is shown of other programs stands in blocks of bash or powershell and is not run.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent
SHOWN = DOCS / "_static" / "shown"
BLOCK = re.compile(
    r"^```(?P<language>sh|python|toml|none)\n(?P<text>.*?)^```\n(?:\n```text\n(?P<printed>.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
PICTURE = re.compile(r"!\[[^\]]*\]\((?:\.\./)?_static/shown/([\w.-]+)\)")
COLUMNS = 80
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_DIGEST = re.compile(r"(?<=sha256:)[0-9a-f]{64}\b|(?<=certificate \d{4}-)[0-9a-f]{8}\b")
"""Of what was computed: its last bits are the processor's."""
_TEXT = re.compile(rb"<text[^>]*>([^<]*)")
_STATUS = re.compile(r"#.*\bexit status (\d+)")
_FIGURE = re.compile(r"<svg .*?</svg>", re.DOTALL)
_SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')
_REPORT = re.compile(r"(?P<report>\w+)-(?P<caption>.+)\.svg")


def executed() -> list[Path]:
    """The pages whose blocks are run."""
    rooms = [page for room in ("tutorials", "howto", "sources") for page in DOCS.glob(f"{room}/*.md")]
    # the translations of a page have its blocks
    return sorted(p for p in [*rooms, DOCS / "install.md", DOCS / "faq.md"] if p.suffixes == [".md"])


def alike(written: str, found: str) -> bool:
    """Words the same; numbers within two of their last digit, which another processor's rounding may move.

    >>> alike("u 0.018 deg", "u 0.019 deg"), alike("u 0.018 deg", "u 0.021 deg")
    (True, False)
    """
    written, found = _DIGEST.sub("digest", written), _DIGEST.sub("digest", found)
    if NUMBER.sub("#", " ".join(written.split())) != NUMBER.sub("#", " ".join(found.split())):
        return False
    for pair in zip(NUMBER.findall(written), NUMBER.findall(found), strict=True):
        one, other = (text.replace("−", "-") for text in pair)
        mantissa, _, power = one.partition("e")
        if abs(float(one) - float(other)) > 2.0 * 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2])):
            return False
    return True


def commands(text: str) -> list[str]:
    r"""The commands of a block, a line that ends with `\` joined to the next.

    >>> commands("inclinometry plan twelve \\\n    -o plan.csv\n# a word\ninclinometry list plans\n")
    ['inclinometry plan twelve -o plan.csv', 'inclinometry list plans']
    """
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def call(line: str) -> None:
    """One command as the program itself runs it; its exit status must be 0, or the one that a comment states."""
    from inclinometry.cli import main

    expected = _STATUS.search(line)
    try:
        main(shlex.split(line, comments=True)[1:])
    except SystemExit as stopped:
        if stopped.code != int(expected[1] if expected else 0):
            raise RuntimeError(f"{line}: exit status {stopped.code}") from None


def run(page: str) -> Iterator[tuple[re.Match[str], str]]:
    """Every block of a page and what it prints, run in the current folder.

    Commands that serve until they are stopped (`bench`) are left alone, and so is what is no command of this program.
    """
    names: dict[str, object] = {"__name__": "__main__"}
    for block in BLOCK.finditer(page):
        text, printed = block["text"], StringIO()
        if block["language"] in ("toml", "none"):
            head, _, rest = text.partition("\n")
            toml = block["language"] == "toml"
            Path(head.strip("#- ")).write_text(text if toml else rest, encoding="utf-8")
            continue
        with redirect_stdout(printed), redirect_stderr(printed):
            try:
                if block["language"] == "python":
                    exec(compile(text, "page", "exec"), names)
                else:
                    for line in commands(text):
                        if line.startswith("inclinometry ") and not line.startswith("inclinometry bench"):
                            call(line)
            except Exception as error:
                raise RuntimeError(f"{text}\n{printed.getvalue()}") from error
        yield block, "\n".join(line.rstrip() for line in printed.getvalue().strip("\n").splitlines())


def filled(page: str) -> str:
    """A page with what its blocks print, run in the current folder."""
    found = {block.start("printed"): (block, text) for block, text in run(page) if block["printed"] is not None}
    for start, (block, text) in sorted(found.items(), reverse=True):
        page = page[:start] + text + "\n" + page[block.end("printed") :]
    return page


def pictures(page: str) -> dict[str, bytes]:
    """The pictures that a page shows, from the folder in which it was run."""
    found = {}
    for name in PICTURE.findall(page):
        made, figure = Path(name), _REPORT.fullmatch(name)
        if made.exists():
            found[name] = made.read_bytes()
        elif figure is None or not Path(f"{figure['report']}.html").exists():
            raise FileNotFoundError(f"{name}: no block of the page makes it")
        else:
            report = Path(f"{figure['report']}.html").read_text(encoding="utf-8")
            label = f'aria-label="{figure["caption"].replace("-", " ")}'.lower()
            drawn = next((one for one in _FIGURE.findall(report) if label in one[:400].lower()), None)
            if drawn is None:
                raise ValueError(f"{name}: no figure of {figure['report']}.html has that caption")
            found[name] = _standalone(drawn).encode()
    return found


def _standalone(figure: str) -> str:
    """A figure of a report as a file of its own: at its size, on white, without the variables of the report's page."""
    width, height = _SIZE.findall(figure)[0]
    size = f'<svg width="{width}pt" height="{height}pt" style="background: white" '
    return re.sub(r"var\(--[\w-]+, (#\w+)\)", r"\1", figure.replace("<svg ", size, 1)) + "\n"


@contextmanager
def terminal(folder: Path) -> Iterator[None]:
    """In a folder, at a terminal of 80 columns without colours."""
    before, environment = Path.cwd(), dict(os.environ)
    keys = str(Path(folder).resolve() / "keys")  # of a laboratory of the page's own
    os.environ |= {"COLUMNS": str(COLUMNS), "NO_COLOR": "1", "MPLBACKEND": "agg", "INCLINOMETRY_KEYS": keys}
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
        os.environ.clear()
        os.environ.update(environment)


def same_picture(one: bytes, other: bytes) -> bool:
    """Of two drawings the words and the number of strokes; of two bitmaps the size, and nearly all of the ink."""
    if not one.startswith(b"\x89PNG"):
        words = [b" ".join(_TEXT.findall(picture)).decode() for picture in (one, other)]
        return one.count(b"<path") == other.count(b"<path") and alike(*words)
    from io import BytesIO

    from matplotlib.image import imread

    here, there = (imread(BytesIO(picture)) for picture in (one, other))
    return bool(here.shape == there.shape and abs(here - there).mean() < 0.02)


def renew(page: Path, folder: Path, *, write: bool = True) -> list[str]:
    """Run a page in a folder, and rewrite its outputs and its pictures where they are not what its blocks give.

    Returns
    -------
    list of str
        What differs.
    """
    text = page.read_text(encoding="utf-8")
    with terminal(folder):
        new = filled(text)
        drawn = pictures(text)
    wrong: dict[Path, bytes] = {}
    old, found = ([m["printed"] for m in BLOCK.finditer(one)] for one in (text, new))
    if not all(a == b or alike(a, b) for a, b in zip(old, found, strict=True)):
        wrong[page] = new.encode()
    for name, picture in drawn.items():
        path = SHOWN / name
        if not path.exists() or not same_picture(path.read_bytes(), picture):
            wrong[path] = picture
    if write:
        SHOWN.mkdir(exist_ok=True)
        for path, content in wrong.items():
            path.write_bytes(content)
    return [path.relative_to(DOCS).as_posix() for path in wrong]
