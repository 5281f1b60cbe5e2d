"""The context of a flight for tests of a single stage."""

from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rtshcua.adapters.clock import SystemClock
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest, FrameBuffer
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.load import EnforcementMode


def request(**changed: Any) -> FlightRequest:
    """Return a request for a flight of the simulated vehicle, with these changes."""
    usual = {
        "bundle": Path("short.bundle"), "link": None, "mode": EnforcementMode.SOFTWARE, "data": Path(), "state": Path(),
        "runs": Path("runs"),
    }  # fmt: skip
    return FlightRequest(**(usual | changed))


def context(of: FlightRequest | None = None, clock: Any = None, **changed: Any) -> FlightContext:
    """Return the context of a flight, without the parts that the stage does not use."""
    never: Any = SimpleNamespace(wish=lambda: None)
    usual: dict[str, Any] = {
        "request": of or request(), "console": None, "clock": clock or SystemClock(), "utc": None, "listening": None,
        "transport": None, "interrupts": never, "frames": FrameBuffer(), "resources": ExitStack(),
    }  # fmt: skip
    return FlightContext(**(usual | changed))


def refusal_of(found: object) -> Refusal:
    """Return the refusal of a stage."""
    assert isinstance(found, Refusal), found
    return found
