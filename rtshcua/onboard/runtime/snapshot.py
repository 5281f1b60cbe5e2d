"""Makes a `View` of a run."""

from rtshcua.model.flat.signal import POSITION
from rtshcua.onboard.runtime.conduct import Conduct
from rtshcua.onboard.runtime.flight import Stage
from rtshcua.onboard.runtime.view import Reading, View


def view_of(conduct: Conduct, at_us: int) -> View:
    """The run as it is at a monotonic time."""
    mission = conduct.loaded.bundle.mission
    current = conduct.queue.current
    return View(
        at_us,
        conduct.stage,
        mission.phases[conduct.queue.phase],
        current.step if current is not None else len(mission.invocations),
        len(mission.invocations),
        _contract(conduct),
        _left_us(conduct, at_us),
        conduct.craft.armed,
        conduct.craft.airborne,
        not conduct.link.down,
        _signals(conduct, at_us),
        tuple(conduct.admission.recent),
        conduct.ending,
    )


def _contract(conduct: Conduct) -> str:
    active, current = conduct.dispatcher.active, conduct.queue.current
    if active is not None:
        return active.command.skill
    return current.contract.name if current is not None else ""


def _left_us(conduct: Conduct, at_us: int) -> int | None:
    active, current, released_us = conduct.dispatcher.active, conduct.queue.current, conduct.queue.released_us
    if conduct.stage is Stage.DECIDING and current is not None and released_us is not None:
        return released_us + current.contract.deadline_us - at_us
    if active is None:
        return None
    if active.until_us is not None:
        return active.until_us - at_us
    if conduct.stage is Stage.RUNNING and current is not None and current.contract.duration_us:
        return active.since_us + current.contract.duration_us - at_us
    return None


def _signals(conduct: Conduct, at_us: int) -> tuple[Reading, ...]:
    state = conduct.monitor.state(at_us)
    readings = []
    for signal in conduct.loaded.bundle.policy.signals:
        slots = range(signal.slot, signal.slot + (2 if signal.kind == POSITION else 1))
        values, age_us = tuple(state.values[slot] for slot in slots), max(state.ages[slot] for slot in slots)
        readings.append(Reading(signal.name, values, age_us, age_us > signal.stale_us))
    return tuple(readings)
