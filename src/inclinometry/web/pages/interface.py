"""The REST interface described on a page of its own, without anything from elsewhere."""

from __future__ import annotations

import json
from html import escape
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

router = APIRouter(include_in_schema=False)

_HEAD = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>REST interface - inclinometry</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="stylesheet" href="/static/bench.css">
</head><body><main class="page" style="display:block"><h1 class="title">REST interface</h1>
<p>Angles in degrees. A program logs in at <code>POST /api/v1/login</code> and sends
<code>Authorization: Bearer TOKEN</code>; a browser sends the header <code>X-CSRF-Token</code> that
<code>GET /api/v1/me</code> gives. The whole description: <a href="/api/openapi.json">openapi.json</a>.</p>"""


@router.get("/api")
def interface(request: Request) -> HTMLResponse:
    """Every route with what it takes."""
    content = request.app.openapi()
    parts = [_HEAD]
    for path, methods in content["paths"].items():
        for method, about in methods.items():
            parts.append(_route(path, method, about, content))
    return HTMLResponse("".join([*parts, "</main></body></html>"]))


def _route(path: str, method: str, about: dict[str, Any], content: dict[str, Any]) -> str:
    takes = [f"{p['name']} ({p['in']})" for p in about.get("parameters", [])]
    body = about.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
    name = body.get("$ref", "").rpartition("/")[2]
    shown = ""
    if name:
        properties = content["components"]["schemas"][name].get("properties", {})
        shown = f"<pre>{escape(json.dumps(properties, indent=1, ensure_ascii=False))}</pre>"
    return (
        f'<details class="panel" style="margin:.5rem 0"><summary><code>{method.upper()} {escape(path)}</code> '
        f"{escape(about.get('description', '').splitlines()[0])}</summary>"
        f"<p>{escape(', '.join(takes))}</p>{shown}</details>"
    )
