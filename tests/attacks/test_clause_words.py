"""Threat: a mission's signer adds a clause to a step, with a text that misrepresents its code.

The code can only tighten the contract; the text is in the log, where an investigator reads why a step was refused.
"""

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import CALM, ENOUGH_CHARGE, MISSION, POLICY
from reference.world import Run, assert_audited, loaded, sealed, try_load
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from rtshcua.front.cli.render.showing.log import show_log
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.mission import Mission
from rtshcua.onboard.calls import is_own

#: a condition that no battery satisfies
FULL = flat.apply(flat.Op.GT, flat.signal(flat.BATTERY), flat.const(10_000))


def held_to(text: str, step: int = 0) -> Mission:
    """A step with a clause that requires more than a full battery, with a misleading text."""
    of = MISSION.invocations[step]
    contract = replace(of.contract, assume=(*of.contract.assume, flat.clause(text, FULL)))
    contract = replace(contract, reads=tuple(sorted({*contract.reads, flat.BATTERY})))
    steps = list(MISSION.invocations)
    steps[step] = replace(of, contract=contract)
    return replace(MISSION, invocations=tuple(steps))


@pytest.mark.parametrize("text", [CALM.text, f"  {ENOUGH_CHARGE.text}\n", POLICY.rules[0].text])
def test_clause_with_text_of_policy_clause_is_refused(text: str) -> None:
    found = try_load(sealed(POLICY, held_to(text)))
    assert isinstance(found, Refusal)
    assert "has the text of a policy clause but different code" in found.text


def test_refusal_by_missions_own_clause_is_marked_as_such() -> None:
    run = Run(loaded(POLICY, held_to("wind.speed < 9 m/s"))).until_over()
    assert_audited(run)
    page = TextPage(bold=False)
    show_log(page, run.lines)
    (why,) = {line.split("because ")[1] for line in str(page).splitlines() if "because" in line}
    assert why.startswith("`wind.speed < 9 m/s`, in the mission's own words")


def test_policy_clause_is_shown_as_policys() -> None:
    step = held_to("wind.speed < 9 m/s").invocations[0]
    own: list[Clause] = [*step.contract.require, *step.contract.assume, *step.contract.maintain]
    assert [is_own(POLICY, step, each) for each in own].count(True) == 1
    assert not is_own(POLICY, step, POLICY.rules[0])
    assert not is_own(POLICY, step, None)


HELD = """import "lib:policies/bridge_inspection.rts"

mission m under bridge_inspection@7 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) { assume battery > 60 % } }
  phase recovery { return_home() }
}
"""


def test_why_shows_owner_of_clause_and_its_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "m.rts"
    source.write_text(HELD)
    command = ["why", str(source), "--step", "1", "--at", "2026-05-01T10:00:00Z", "--state", "battery=50 %"]
    assert main(command) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "because `battery > 60 %`, in the mission's own words" in out
    assert "> assume false: `battery > 60 %`, in the mission's own words with battery = 50 %" in out
    assert main([*command, "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["own"] is True
    assert main([*command[:-1], "battery=32 %", "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["own"] is False, "the skill's own asks for 35 %"
