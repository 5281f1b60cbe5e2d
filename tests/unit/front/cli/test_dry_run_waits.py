"""`run --dry-run` while it waits: it names the reason, can be interrupted, and does not age signals."""

import json
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from reference.flat_case import LINK
from reference.flying import context, request
from reference.world import START, FakeVehicle, loaded
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.app.fly import dry_run
from rtshcua.app.fly.stop_wishes import Wish
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.render.showing.rehearsed import show_rehearsal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Event, Readings, Ready

SECOND = 1_000_000


class Told:
    """The parameters of a vehicle with a single parameter."""

    values = {"RTL_RETURN_ALT": 30.0}  # noqa: RUF012

    def read(self, name: str) -> None:
        """Request the parameter."""

    def is_known(self, name: str) -> bool:
        return name in self.values


class World:
    """A vehicle that becomes ready after so many seconds of the machine; its clock runs `speed` times as fast."""

    def __init__(self, ready_s: float, *, speed: int = 1, wish_s: float = 1e9, missing: int | None = None) -> None:
        self.s = 0.0
        self.said: list[str] = []
        self._ready_s, self._speed, self._wish_s, self._missing = ready_s, speed, wish_s, missing
        self.driver = SimpleNamespace(unready="the vehicle's checks before arming fail", flavour=PX4, settings=Told())

    def monotonic(self) -> float:
        return self.s

    def now(self) -> Now:
        passed_us = round(self.s * SECOND) * self._speed
        return Now(START.monotonic_us + passed_us, START.utc_us + passed_us, START.utc_error_us)

    def us_in(self, seconds: float) -> int:
        return round(seconds * SECOND) * self._speed

    def wish(self) -> Wish | None:
        return Wish.LAND if self.s >= self._wish_s else None

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        self.s += 0.5
        values = FakeVehicle().values.items()
        now_us = self.now().monotonic_us
        events: list[Event] = [Readings(now_us, tuple(each for each in values if each[0] != self._missing))]
        if self.s >= self._ready_s and self.driver.unready is not None:
            self.driver.unready = None
            events.append(Ready(now_us))
        return events


def rehearsed(
    world: World, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], **words: Any
) -> tuple[ExitCode, dict[str, Any]]:
    monkeypatch.setattr(dry_run, "time", world)
    monkeypatch.setattr(dry_run, "not_begun", lambda *_: words.get("refusal"))
    console: Any = SimpleNamespace(say=world.said.append)
    of = request(dry_run=True, settings=dict.fromkeys(words.get("sets", ()), 0))
    shared = context(of, world, console=console, interrupts=world, utc=SimpleNamespace(waits=False))
    signing: Any = SimpleNamespace(notes=words.get("notes", []), unheard=words.get("unheard", frozenset()))
    begun: Any = SimpleNamespace(loaded=loaded(), apart=None)
    connected: Any = SimpleNamespace(vehicle=world, events=[], signing=signing)
    code = show_rehearsal(dry_run.rehearse_flight(shared, begun, connected), as_json=True)
    said: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert said["exit_code"] == code
    return code, said


def test_dry_run_lists_pending_conditions(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    world = World(12)
    code, said = rehearsed(world, monkeypatch, capsys, notes=["the radio"])
    assert (code, said["ready"], said["notes"]) == (ExitCode.OK, True, ["the radio"])
    waits = "waiting for the vehicle: the vehicle's checks before arming fail; until 60 s"
    assert world.said == ["note: the radio", waits]


def test_interrupted_dry_run_reports_its_state(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = rehearsed(World(1e9, wish_s=7), monkeypatch, capsys)
    assert code is ExitCode.INTERRUPTED
    assert (said["interrupted"], said["ready"], len(said["steps"])) == (True, False, 4)


def test_dry_run_wait_does_not_age_signals(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = rehearsed(World(59, speed=50), monkeypatch, capsys)
    assert {step["reason"] for step in said["steps"]} == {"admitted"}
    assert code is ExitCode.OK


def test_dry_run_refuses_a_parameter_the_vehicle_does_not_report(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert rehearsed(World(1), monkeypatch, capsys, sets=["RTL_RETURN_ALT"])[0] is ExitCode.OK
    world = World(1)
    code, said = rehearsed(world, monkeypatch, capsys, sets=["RTL_RETURN_ALT", "FENCE_RADIUS"])
    assert code is ExitCode.REFUSED
    untold = "the vehicle does not report `FENCE_RADIUS`, which is to be set"
    assert said["refusal"] == f"{untold}; `FENCE_RADIUS` is a parameter of ArduPilot, and this is PX4"
    assert dry_run.SETTINGS_S <= world.s <= dry_run.SETTINGS_S + 1


def test_dry_run_refuses_a_flown_bundle(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = rehearsed(World(1), monkeypatch, capsys, refusal="a bundle flies once")
    assert (code, said["refusal"]) == (ExitCode.REFUSED, "a bundle flies once")


def test_a_signal_that_cannot_come_is_not_waited_for_in_hope(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert rehearsed(World(1, missing=LINK), monkeypatch, capsys)[0] is ExitCode.OK
    assert rehearsed(World(1, missing=LINK), monkeypatch, capsys, unheard=frozenset({LINK}))[0] is ExitCode.REFUSED
