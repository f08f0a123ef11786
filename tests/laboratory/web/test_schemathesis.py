"""The REST interface under made-up requests: no error of the server, every answer as described."""

from __future__ import annotations

import warnings

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of the tool's own modules
    import schemathesis
    from schemathesis.checks import not_a_server_error
    from schemathesis.specs.openapi.checks import (
        content_type_conformance,
        response_headers_conformance,
        response_schema_conformance,
        status_code_conformance,
    )

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
EXAMPLES = 12


@pytest.fixture(scope="module")
def interface(open_server):
    with open_server.local() as browser:
        browser.put("/api/v1/tools/IN-7", json={"name": "tool"})
        browser.put("/api/v1/rigs/stand", json={"sd_deg": [0.1, 0.1, 0.1]})
        order = {"serial": "IN-7", "rig": "stand", "plan": "twelve"}
        session = browser.post("/api/v1/sessions", json=order).json()["id"]
        content = browser.get("/api/openapi.json").json()
    known = {"serial": "IN-7", "rig": "stand", "plan": "orthogonal", "session": session, "kind": "session"}
    return schemathesis.openapi.from_dict(content), known


@pytest.mark.long
@pytest.mark.parametrize("method", ["get", "put", "post"])
def test_made_up_requests(interface, open_server, method):
    with open_server.local() as browser:
        headers = {"X-CSRF-Token": browser.headers["X-CSRF-Token"]}
    described, known = interface
    for found in described.get_all_operations():
        operation = found.ok()
        if operation.method == method:
            _attack(operation, known, open_server.url, headers)


def _mend(content, known):
    """Put what is known in place of what was made up."""
    if isinstance(content, dict):
        content.update({name: value for name, value in known.items() if name in content})


def _attack(operation, known, url, headers):
    @settings(
        max_examples=EXAMPLES,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(), meant=st.booleans(), number=st.integers(1, 13))
    def attacked(case, meant, number):
        if meant:  # what is there, so that more than the refusal of unknown names is tried
            _mend(case.path_parameters, known | {"number": number})
            _mend(case.body, known)
        answer = case.call(base_url=url, headers=headers, timeout=30)
        case.validate_response(answer, checks=CHECKS)

    attacked()
