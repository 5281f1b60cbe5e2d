"""Replacements, opened by hand: their flight, and the steps that a key may replace."""

from dataclasses import replace as with_fields

from msgspec.structs import replace

from reference.documents import low, shorter
from reference.world import FLIGHT, MISSION_KEY, ROOT, START, VEHICLE
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.keys import ANY, Duty
from rtshcua.wire.replacement import fit_replacement, open_replacement, sign_replacement
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows

IN_FORCE = low().bundle
NEW = shorter(low())
OTHER_FLIGHT = bytes([7]) * 16
AGENT, OPERATOR = SourceKind.AGENT, SourceKind.OPERATOR


def through(mission: Mission, source: int) -> Mission:
    """The mission, proposed through one source."""
    return replace(mission, invocations=tuple(replace(each, source=source) for each in mission.invocations))


def trusting(*sources: str) -> TrustRoot:
    """The root with a mission key for these sources only."""
    key = MISSION_KEY.verification(roles=("operator",), sources=sources, vehicles=(VEHICLE,), policies=(ANY,))
    return replace(ROOT, keys=tuple(key if each.duty is Duty.MISSION else each for each in ROOT.keys))


def replaced(
    new: Mission, old: Bundle = IN_FORCE, kept: int = 2, root: TrustRoot = ROOT, flight: bytes | None = FLIGHT
) -> str | int:
    """How many steps are in force after a replacement signed for `FLIGHT`; the slug of why it is refused."""
    document = sign_replacement(new, over=old, flight=FLIGHT, kept=kept, key=MISSION_KEY)
    try:
        found = open_replacement(document, root=root, vehicle=VEHICLE, flight=flight, bundle=old, now=START)
        return len(fit_replacement(found, old, released=0).mission.invocations)
    except Untrusted as error:
        return error.slug


@rows(("flight", "found"), [(FLIGHT, 3), (OTHER_FLIGHT, "other-flight"), (b"", "other-flight"), (None, 3)])
def test_replacement_is_for_named_flight_unless_any_is_accepted(flight: bytes | None, found: str | int) -> None:
    assert replaced(NEW, flight=flight) == found


@rows(
    ("sources", "old", "new", "found"),
    [
        (("agent",), AGENT, AGENT, 3),
        (("agent",), OPERATOR, AGENT, "wrong-source"),
        (("operator",), AGENT, OPERATOR, 3),
        (("operator",), OPERATOR, OPERATOR, 3),
        (("operator",), AGENT, AGENT, "wrong-source"),  # it may not propose in the agent's place
        (("agent", "operator"), OPERATOR, AGENT, 3),
    ],
)
def test_personal_key_may_replace_agent_steps_but_not_vice_versa(
    sources: tuple[str, ...], old: int, new: int, found: str | int
) -> None:
    flying = with_fields(IN_FORCE, mission=through(IN_FORCE.mission, old))
    assert replaced(through(NEW, new), flying, kept=0, root=trusting(*sources)) == found
