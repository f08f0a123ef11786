"""A JSON record on disk with one thing changed."""

from __future__ import annotations

import json


def put(*keys_and_value):
    """A change: the last is the value, before it the keys on the way to it."""
    *keys, last, value = keys_and_value

    def change(content):
        for key in keys:
            content = content[key]
        content[last] = value

    return change


def changed(path, change):
    """The path of the record, rewritten by a function of its content."""
    content = json.loads(path.read_text("utf-8"))
    change(content)
    path.write_text(json.dumps(content), "utf-8")
    return path
