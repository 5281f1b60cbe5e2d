import pytest
from msgspec.structs import replace

from reference.flat_case import CONTRACTS, GOTO, HOVER, MISSION, PATH, POLICY, RULES, M, S, link
from rtshcua.model.flat.contract import QUANTITY, Motion, MotionKind, Parameter
from rtshcua.model.flat.zone import project
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.ports import Command
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from virtual.rows import rows

COMMANDS = Commands(POLICY, MISSION)


def test_a_step_flies_its_plan() -> None:
    command = COMMANDS.command(STEP, 2, -1, 7)
    assert (command.token, command.skill, command.kind) == (7, "inspect_area", MotionKind.COVER)
    assert (command.path, command.altitude, command.speed) == (PATH, 20 * M, 4 * M)
    back = [project(POLICY.projection, *command.geo[at : at + 2]) for at in range(0, len(PATH), 2)]
    for (x, y), at in zip(back, range(0, len(PATH), 2), strict=True):
        assert abs(x - PATH[at]) <= 12, "1e-7 degree is about a centimetre"
        assert abs(y - PATH[at + 1]) <= 12


def test_a_link_flies_its_skill() -> None:
    assert COMMANDS.command(FALLBACK_LINK, 2, 1, 8) == Command(8, "return_home", MotionKind.HOME, (), (), 0, 0)
    assert COMMANDS.command(CONTINGENCY_LINK, -1, 2, 9).kind == MotionKind.LAND


def test_a_link_to_a_place_flies_there() -> None:
    policy = replace(POLICY, contingency=(link(GOTO, 10 * M, -20 * M, 15 * M), *POLICY.contingency))
    command = Commands(policy, MISSION).command(CONTINGENCY_LINK, -1, 0, 1)
    assert (command.kind, command.path, command.altitude) == (MotionKind.FLY, (10 * M, -20 * M), 15 * M)
    assert len(command.geo) == 2


def test_a_degrade_rule_has_a_target() -> None:
    assert COMMANDS.command(FALLBACK_LINK, 0, -len(RULES), 1).skill == "return_home"


@rows(
    ("kind", "step", "link_number"),
    [
        (STEP, 4, -1),
        (STEP, -1, -1),
        (FALLBACK_LINK, 0, 1),
        (FALLBACK_LINK, -1, 0),
        (FALLBACK_LINK, 0, -1),
        (FALLBACK_LINK, 0, -99),
        (CONTINGENCY_LINK, -1, 3),
        (CONTINGENCY_LINK, -1, -1),
        (3, 0, 0),
    ],
)
def test_command_outside_bundle_raises(kind: int, step: int, link_number: int) -> None:
    with pytest.raises(LookupError):
        COMMANDS.command(kind, step, link_number, 1)


def test_a_link_with_a_time_of_its_own_holds_for_that() -> None:
    time = Parameter("time", QUANTITY, "duration", 0, S, 60 * S, ())
    hover = replace(CONTRACTS[HOVER], parameters=(time,), motion=Motion(MotionKind.HOLD, -1, -1, 0))
    contracts = tuple(hover if contract.name == "hover" else contract for contract in CONTRACTS)
    chain = (link(HOVER, 10 * S, limit_us=20 * S), link(HOVER, 10 * S))
    commands = Commands(replace(POLICY, contracts=contracts, contingency=chain), MISSION)
    assert commands.command(CONTINGENCY_LINK, -1, 0, 1).hold_us == 0, "the runtime ends it after 20 s"
    assert commands.command(CONTINGENCY_LINK, -1, 1, 1).hold_us == 10 * S
