"""The boundary in the secure world answers as the one in Python does."""

from pathlib import Path

import pytest

from boundary import sessions_in_c_and_python as c_and_python
from boundary.secure_world import InSecureWorld, lower_limits, needs_emulator

pytestmark = needs_emulator

#: in CI 20,000 requests to decide, in the soak a million
CHUNKS, CHUNK = 5, 2_000
SOAK_CHUNKS, SOAK_CHUNK = 100, 10_000


def answer_the_same(first: int, requests: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A start takes a while: fewer than of the process, with more calls in each."""
    lower_limits(monkeypatch)
    monkeypatch.setattr(c_and_python, "STARTS", (1, 2, 3))
    monkeypatch.setattr(c_and_python, "CALLS", (300, 1_000, 2_000))
    counts = c_and_python.ask_both(first, requests, folder, InSecureWorld)
    assert c_and_python.decided(counts) >= requests


@pytest.mark.clients
@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_both_answer_the_same(chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer_the_same(chunk * CHUNK, CHUNK, tmp_path, monkeypatch)


@pytest.mark.soak
@pytest.mark.parametrize("chunk", range(SOAK_CHUNKS))
def test_both_answer_a_million_requests_the_same(chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer_the_same((1 + chunk) * SOAK_CHUNK, SOAK_CHUNK, tmp_path, monkeypatch)
