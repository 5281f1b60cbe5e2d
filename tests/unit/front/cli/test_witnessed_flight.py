"""`run --witness` around a flight: refusals before it, and no effect without witnesses."""

import socket
from pathlib import Path

import pytest

from reference.flying import refusal_of
from rtshcua.adapters.vehicle.address import Address
from rtshcua.adapters.witness_link import Anchor, WitnessTrouble
from rtshcua.app.fly import witnesses
from rtshcua.app.fly.witnesses import addresses, find_witnesses
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.onboard.ports import Anchored, Noted

THERE = Address("udpout", "127.0.0.1", 14_600)
KEYS = frozenset({bytes(32)})


class Client:
    """A client with scripted reports of its thread."""

    waited: list[tuple[object, ...]]

    def __init__(self, *given: object) -> None:
        self.given = given
        Client.waited = []

    def news(self) -> list[Anchor | WitnessTrouble]:
        return [Anchor("a note"), WitnessTrouble("a word")]

    def finish(self, *last: object) -> list[WitnessTrouble]:
        Client.waited.append(last)
        return [WitnessTrouble("the end")]


def test_addresses() -> None:
    assert addresses(["udpout:127.0.0.1:14600"]) == (THERE,)
    for text in ("udpin:127.0.0.1:14600", "x"):
        with pytest.raises(ValueError, match=r"cannot be used here|is not a kind"):
            addresses([text])


def test_without_witnesses_there_is_nothing(tmp_path: Path) -> None:
    nobody = find_witnesses((), frozenset())
    nobody.begin(tmp_path / "none", lambda: 0)
    assert nobody.events(0) == []
    nobody.finish(pytest.fail, closed=True)


def test_a_root_that_names_none() -> None:
    refused = refusal_of(find_witnesses([THERE], frozenset()))
    assert (refused.code, refused.slug) == (ExitCode.UNTRUSTED, "no-witness")


def test_a_host_that_nobody_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(host: str) -> str:
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(witnesses.socket, "gethostbyname", unknown)
    refused = refusal_of(find_witnesses([Address("udpout", "nowhere", 1)], KEYS))
    assert (refused.code, refused.slug) == (ExitCode.LINK, "witness-address")


def test_received_anchors_are_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(witnesses, "WitnessClient", Client)
    for closed, waited in ((True, ()), (False, (0,))):
        made = find_witnesses([THERE], KEYS)
        made.begin(tmp_path / "log.jsonl", lambda: 0)
        assert made.events(7) == [Anchored(7, "a note"), Noted(7, "a word")]
        said: list[str] = []
        made.finish(said.append, closed=closed)
        made.finish(said.append, closed=closed)
        assert (said, Client.waited) == (["the end"], [waited])
        assert made.events(8) == []
