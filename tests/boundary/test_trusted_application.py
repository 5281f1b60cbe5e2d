"""The boundary in OP-TEE answers as the one in Python does."""

from pathlib import Path

import pytest

from boundary import sessions_in_c_and_python as c_and_python
from boundary.secure_world import lower_limits
from boundary.trusted_application import InTrustedApplication, needs_optee

pytestmark = [needs_optee, pytest.mark.soak]

#: 100,000 requests to decide
CHUNKS, CHUNK = 50, 2_000


@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_both_answer_the_same(chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Booting takes some seconds: few starts, with many calls in each."""
    lower_limits(monkeypatch)
    monkeypatch.setattr(c_and_python, "STARTS", (1, 2))
    monkeypatch.setattr(c_and_python, "CALLS", (1_000, 2_000, 3_000))
    monkeypatch.setattr("rtshcua.adapters.boundary.optee.ANSWER_S", 20.0)  # nothing flies that waits
    counts = c_and_python.ask_both(chunk * CHUNK, CHUNK, tmp_path, InTrustedApplication)
    assert c_and_python.decided(counts) >= CHUNK
