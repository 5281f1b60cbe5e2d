"""Faults in flight, over real UDP: each ends with its exit code and a valid log."""

import os
import signal
import socket
import threading
from random import Random
from typing import Any

import pytest

from virtual import case

IDENTITY = ("--vehicle", "quad-07")


def closed(run: Any, ending: str) -> None:
    """Check that the log is valid and closed with this ending."""
    last = run.log()[-1]
    assert (last["type"], last["ending"]) == ("close", ending)
    assert last["seq"] == len(run.log()) - 1
    assert run.summary["whole"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.soak), signal.SIGTERM])
def test_interrupt_flies_the_fallback_first(ground: Any, number: signal.Signals) -> None:
    run = ground.run(ground.bundle())
    run.until("dispatched", step=1)
    run.signal(number)
    assert run.end().code == 130
    closed(run, "interrupted")
    assert "interrupted" in run.effects()
    assert run.dispatched()[-1] in ("return_home", "emergency_land")


def test_interrupt_on_the_ground_sends_nothing(ground: Any) -> None:
    run = ground.run(ground.bundle(), "--fault", "gps-loss,at=0s")
    run.until("plan")
    run.signal(signal.SIGINT)
    assert run.end().code == 130
    closed(run, "interrupted")
    assert run.dispatched() == []


@pytest.mark.slow
def test_three_interrupts_leave_the_vehicle_and_keep_the_log(ground: Any) -> None:
    run = ground.run(ground.bundle(), speed=2)
    run.until("dispatched", step=1)
    for count in range(3):
        run.signal(signal.SIGINT)
        if count < 2:
            run.until("note")
            run.events.clear()
    assert run.end().code == 130
    closed(run, "interrupted")
    assert [event for event in run.effects() if event != "boundary"][-1] == "left"
    assert run.dispatched()[-1] in ("return_home", "emergency_land"), "it is told to come down before it is left"


@pytest.mark.slow
def test_pilot_takeover_ends_the_run(ground: Any) -> None:
    run = ground.run(ground.bundle(), "--fault", "pilot,at=15s,mode=position").end()
    assert run.code == 7
    closed(run, "stood-down")
    assert "taken-over" in run.effects()


@pytest.mark.soak
def test_low_battery_in_flight_returns_home(ground: Any) -> None:
    run = ground.run(ground.bundle(), "--fault", "battery,at=12s,level=20%").end()
    assert run.code == 6
    closed(run, "aborted")
    assert run.dispatched()[-1] == "return_home"
    assert "violated" in run.effects()


@pytest.mark.slow
def test_low_battery_on_the_ground_keeps_the_bundle_unused(ground: Any) -> None:
    bundle = ground.bundle()
    run = ground.run(bundle, "--battery", "20").end()
    assert run.code == 5
    closed(run, "refused")
    assert run.dispatched() == []
    assert "no command was sent: the bundle can be run again" in [e.get("text") for e in run.events]
    charged = ground.run(bundle)
    charged.until("dispatched", step=0)
    charged.signal(signal.SIGINT)
    assert charged.end().code == 130
    assert ground.run(bundle).end().events[-1]["slug"] == "replayed", "it was told to take off"


@pytest.mark.soak
def test_silent_vehicle_ends_the_run(ground: Any) -> None:
    """It is awaited for its endurance; after an interrupt for half a minute."""
    run = ground.run(ground.bundle(), "--fault", "link-silence,at=12s")
    run.until("link-lost")
    run.signal(signal.SIGINT)
    assert run.end().code == 8
    closed(run, "link-lost")
    assert [event for event in run.effects() if event != "boundary"][-1] == "stood-down"


@pytest.mark.slow
def test_dead_simulated_vehicle_ends_the_run(ground: Any) -> None:
    run = ground.run(ground.bundle())
    run.until("dispatched", step=1)
    os.kill(run.child("rtshcua.simulation"), signal.SIGKILL)
    run.until("link-lost")
    run.signal(signal.SIGINT)
    assert run.end().code == 8
    closed(run, "link-lost")


@pytest.mark.slow
def test_killed_view_does_not_stop_the_flight(ground: Any) -> None:
    run = ground.run(ground.bundle(case.low_steps(leg=False)))
    run.until("dispatched", step=1)
    os.kill(run.child("rtshcua.front.cli.render.live"), signal.SIGKILL)
    assert run.end().code == 74  # the flight completed, but its output was lost
    assert run.log()[-1]["ending"] == "completed"


@pytest.mark.slow
def test_stopped_view_does_not_stop_the_flight(ground: Any) -> None:
    run = ground.run(ground.bundle(case.low_steps(leg=False)))
    run.until("dispatched", step=1)
    view = run.child("rtshcua.front.cli.render.live")
    os.kill(view, signal.SIGSTOP)
    while not (run.folder / "summary.json").exists():
        assert run.process.poll() is None
        threading.Event().wait(0.05)
    os.kill(view, signal.SIGCONT)
    assert run.end().code == 0


class Relay(threading.Thread):
    """Forwards frames between vehicle and runtime, and adds garbage to the vehicle's."""

    def __init__(self, to: int) -> None:
        super().__init__(daemon=True)
        self.to = ("127.0.0.1", to)
        self.inner = self.bound()
        self.outer = self.bound()
        self.port = self.inner.getsockname()[1]
        self.added = 0

    @staticmethod
    def bound() -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind(("127.0.0.1", 0))
        return made

    def run(self) -> None:
        chance = Random(7)
        vehicle = None

        def back() -> None:
            while True:
                data = self.outer.recv(65_535)
                if vehicle is not None:
                    self.inner.sendto(data, vehicle)

        threading.Thread(target=back, daemon=True).start()
        while True:
            data, vehicle = self.inner.recvfrom(65_535)
            bent = bytearray(data)
            bent[chance.randrange(len(bent))] ^= 1 + chance.randrange(255)
            for garbage in (
                chance.randbytes(chance.randrange(1, 300)),
                bytes(bent),
                data[: chance.randrange(len(data))],
            ):
                self.added += 1
                self.outer.sendto(garbage, self.to)
            self.outer.sendto(data, self.to)


@pytest.mark.slow
def test_garbage_on_the_link_has_no_effect(ground: Any, port: int) -> None:
    relay = Relay(port)
    relay.start()
    ground.vehicle(relay.port, speed=3)  # slower: all the garbage is read, and what is permitted for 1.5 s must leave
    bundle = ground.bundle(case.low_steps(leg=False))
    run = ground.run(bundle, "--connect", f"udpin:127.0.0.1:{port}", *IDENTITY, speed=3).end()
    assert run.code == 0, run.stderr
    closed(run, "completed")
    assert relay.added > 1_000
