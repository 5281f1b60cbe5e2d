"""An unknown method is answered as JSON-RPC specifies."""

from typing import get_args

import mcp_types as types
import pytest

from rtshcua.front.mcp.messages import METHODS, NO_METHOD, unknown_method


def test_an_unknown_method_is_answered_as_that() -> None:
    wrong = unknown_method({"id": 7, "method": "tools/destroy"})
    assert wrong is not None
    assert (wrong.code, wrong.id) == (NO_METHOD, 7)
    assert "`tools/destroy`" in wrong.text
    long = unknown_method({"id": 7, "method": "x" * 10_000})
    assert long is not None
    assert len(long.text) < 200


@pytest.mark.parametrize("method", ["initialize", "ping", "tools/call", "tools/list", "resources/subscribe"])
def test_known_methods_are_left_to_the_sdk(method: str) -> None:
    assert method in METHODS
    assert unknown_method({"id": 1, "method": method}) is None


def test_a_notification_is_never_answered() -> None:
    assert unknown_method({"method": "notifications/none-such"}) is None
    assert unknown_method({"id": 1}) is None


def test_the_methods_are_those_of_the_sdk() -> None:
    requests = get_args(types.ClientRequest)
    assert {name for each in requests for name in get_args(each.model_fields["method"].annotation)} == METHODS
