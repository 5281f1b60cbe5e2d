"""An autopilot binding for a person and for a program."""

from rtshcua.app.autopilot_bindings import agreed, apart, described
from rtshcua.app.wording import utc
from rtshcua.front.cli.render.showing.page import TextPage, named
from rtshcua.model.quantity import Dimension, display
from rtshcua.wire import cose, names
from rtshcua.wire.autopilot_binding import MAX_AUTOPILOT_BINDING, AutopilotBinding, read_autopilot_binding


def is_autopilot_binding(data: bytes) -> bool:
    """Whether these bytes, which look like a signed envelope, say that they hold a binding. Raises `EnvelopeError`."""
    limit = max(len(data), MAX_AUTOPILOT_BINDING)
    return cose.unverified(data, limit=limit).content_type == names.AUTOPILOT_BINDING.content_type


def show_autopilot_binding(page: TextPage, data: bytes) -> dict[str, object]:
    """Add a binding to the page, and return it as JSON. Raises `Untrusted`."""
    envelope = cose.unverified(data, limit=max(len(data), MAX_AUTOPILOT_BINDING))
    binding = read_autopilot_binding(envelope.payload)
    page.head(f"Autopilot binding of {len(data)} bytes (not verified: `verify-log` does that)")
    page.row("signed by", f"key {envelope.kid.hex()}")
    page.row("issued", utc(binding.issued_at_us))
    bound_rows(page, binding)
    return {"kind": "autopilot-binding", "verified": False, "key": envelope.kid.hex(), "binding": named(binding)}


def bound_rows(page: TextPage, binding: AutopilotBinding) -> None:
    """Add what is bound, and how far it agrees."""
    page.row("file", f"{binding.file}: {binding.size} bytes, {described(binding)}")
    page.row("SHA-256", binding.digest.hex())
    page.row("vehicle", binding.vehicle)
    page.row("flight", binding.flight.hex())
    page.row(
        "log", f"{binding.records} records, {'closed' if binding.closed else 'not closed'}, root {binding.root.hex()}"
    )
    page.row("clock", clock_told(binding))
    page.row("track", f"by {binding.source}: {agreed(binding)}")
    if binding.agreed < binding.points:
        page.row("not shown", apart(binding))


def clock_told(binding: AutopilotBinding) -> str:
    """The offset of the clocks, as text."""
    by = "the telemetry" if binding.clock == "telemetry" else "GPS time alone"
    offset, error = _seconds(binding.offset_us), display(binding.error_us, Dimension.DURATION)
    text = f"the autopilot booted at {offset} of the flight, by {by}, error {error}"
    if binding.utc_apart_us is None:
        return text
    return f"{text}; the autopilot's UTC differs by {_seconds(binding.utc_apart_us)}"


def _seconds(us: int) -> str:
    sign, us = ("-" if us < 0 else ""), abs(us)
    return f"{sign}{us // 1_000_000}.{us % 1_000_000 // 1_000:03d} s"
