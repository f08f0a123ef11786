"""The REST interface: the same use cases as the pages and the command line, for programs; angles in degrees."""

from __future__ import annotations

from fastapi import APIRouter

from inclinometry.web.api import certificates, ledger, people, registry, results, sessions

router = APIRouter(prefix="/api/v1")
for part in (people, registry, sessions, results, certificates, ledger):
    router.include_router(part.router)
