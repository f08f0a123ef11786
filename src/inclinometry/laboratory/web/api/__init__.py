"""The REST interface: the same use cases as the pages and the command line, for programs; angles in degrees."""

from __future__ import annotations

from fastapi import APIRouter, Depends

from inclinometry.laboratory.web.api import access, certificates, ledger, people, registry, results, sessions, tables

router = APIRouter(prefix="/api/v1", dependencies=[Depends(access.strict_body)])
# a serial number may hold a slash: what follows it must be looked for first
for part in (people, sessions, results, registry, certificates, tables, ledger):
    router.include_router(part.router)
