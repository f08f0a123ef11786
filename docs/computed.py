"""The computed numbers and tables of the pages: they stand in the text between <!-- name --> and <!-- /name -->.

    python docs/computed.py                  works all of them out (five minutes of one core) and rewrites the pages
    python docs/computed.py gyro_figures     those of some modules of docs/support only
    python docs/computed.py shown            runs the blocks of the tutorials and how-tos, rewrites what they show
    python docs/computed.py shown cave       the same for pages of that name

So the pages can be read without building anything, and building them works nothing out. A new number is written as
{{ name }} and put in place by this program; tests/docs/test_computed.py holds those that are quick to work out against
the text.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent
MODULES = (
    "drawing",
    "figures",
    "survey_figures",
    "position_figures",
    "gyro_figures",
    "motion_figures",
    "fleet_figures",
    "honest_figures",
    "glossary_table",
    "sources",
)
ROOMS = ("methods", "howto", "sources", "tutorials")
BLOCK = re.compile(r"<!-- (?P<name>[a-zA-Z]\w*) -->(?P<text>.*?)<!-- /(?P=name) -->", re.DOTALL)
_NEW = re.compile(r"\{\{ (\w+) \}\}")
# a comment that begins a line would end the paragraph: the number goes to the end of the line before
_FIRST = re.compile(r"\n( *)(\{\{ \w+ \}\}[,.;:%]?) (?=\S)")


def pages() -> list[Path]:
    """Every page written by hand."""
    return sorted([*HERE.glob("*.md"), *(page for room in ROOMS for page in HERE.glob(f"{room}/*.md"))])


def written(text: str, values: Mapping[str, str]) -> str:
    """A page with its computed parts replaced by the values that are known."""
    text = _FIRST.sub(r" \2\n\1", text)
    text = _NEW.sub(lambda m: f"<!-- {m[1]} --><!-- /{m[1]} -->" if m[1] in values else m[0], text)
    return BLOCK.sub(lambda m: _framed(m["name"], values.get(m["name"], m["text"])), text)


def _framed(name: str, value: str) -> str:
    value = value.strip()
    return f"<!-- {name} -->" + (f"\n{value}\n\n" if value.startswith("|") else value) + f"<!-- /{name} -->"


def worked_out(names: list[str], say: Callable[[str], None] = print) -> dict[str, str]:
    """The values of some modules."""
    sys.path[:0] = [str(HERE), str(HERE.parent)]
    values: dict[str, str] = {}
    for number, name in enumerate(names, 1):
        say(f"{number} of {len(names)}: {name}")
        values |= import_module(f"support.{name}").everything()
    return values


def shown(names: list[str]) -> int:
    """Run the blocks of pages and rewrite the outputs and pictures that they show."""
    sys.path[:0] = [str(HERE), str(HERE.parent / "src")]
    from support import blocks

    for page in blocks.executed():
        if not names or page.stem in names:
            print(f"running {page.relative_to(HERE)}", flush=True)
            with TemporaryDirectory() as folder:
                for path in blocks.renew(page, Path(folder)):
                    print(f"{path} rewritten")
    return 0


def main(names: list[str]) -> int:
    """Command line."""
    if names[:1] == ["shown"]:
        return shown(names[1:])
    unknown = sorted(set(names) - set(MODULES))
    if unknown:
        print(f"no such module: {', '.join(unknown)}; there are {', '.join(MODULES)}", file=sys.stderr)
        return 2
    values = worked_out(names or list(MODULES), lambda line: print(line, flush=True))
    for page in pages():
        old = page.read_text(encoding="utf-8")
        new = written(old, values)
        if new != old:
            page.write_text(new, encoding="utf-8")
            print(f"{page.relative_to(HERE.parent)} rewritten")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
