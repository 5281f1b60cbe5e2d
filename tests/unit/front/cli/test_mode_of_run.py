"""The place of decisions in `run`: a separate boundary process for real vehicles, if its program exists."""

from pathlib import Path

import pytest

from reference.flying import context, request
from reference.world import loaded
from rtshcua.adapters.boundary.process import UNBUILT, Measure
from rtshcua.adapters.doctor.diagnosis import MissionVerdict
from rtshcua.app.fly.connect import sign_link
from rtshcua.app.fly.link_signing import LinkSigning
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands import doctor
from rtshcua.front.cli.options import flight_options
from rtshcua.library import root as library
from rtshcua.onboard.enforcement.load import EnforcementMode

BUILT = Path("/usr/lib/rtshcua-boundary")


@pytest.mark.parametrize(
    ("asked", "own", "named", "built", "found"),
    [
        (None, True, False, True, (EnforcementMode.SOFTWARE, False)),
        (None, True, False, False, (EnforcementMode.SOFTWARE, False)),
        (None, False, False, True, (EnforcementMode.PROCESS, False)),
        (None, False, False, False, (EnforcementMode.SOFTWARE, True)),
        (None, False, True, False, (EnforcementMode.PROCESS, False)),  # refused, because a boundary user was requested
        (None, True, True, True, (EnforcementMode.PROCESS, False)),
        (EnforcementMode.SOFTWARE, False, False, True, (EnforcementMode.SOFTWARE, False)),
        (EnforcementMode.SOFTWARE, False, False, False, (EnforcementMode.SOFTWARE, False)),
        (EnforcementMode.PROCESS, True, False, False, (EnforcementMode.PROCESS, False)),
        (EnforcementMode.NONE, True, False, True, (EnforcementMode.NONE, False)),
    ],
)
def test_the_mode_that_counts(
    asked: EnforcementMode | None,
    own: bool,
    named: bool,
    built: bool,
    found: tuple[EnforcementMode, bool],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(flight_options, "program", lambda: BUILT if built else None)
    assert flight_options.mode_of(asked, own=own, named=named) == found


@pytest.mark.parametrize("unbuilt", [True, False])
def test_missing_boundary_program_is_noted(tmp_path: Path, unbuilt: bool) -> None:
    signing = sign_link(context(request(state=tmp_path, unbuilt=unbuilt)), loaded())
    assert isinstance(signing, LinkSigning)
    assert any(UNBUILT in note for note in signing.notes) == unbuilt


@pytest.mark.parametrize("built", [True, False])
def test_the_doctor_says_whether_there_is_one(built: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (doctor, flight_options):
        monkeypatch.setattr(module, "program", lambda: BUILT if built else None)
    monkeypatch.setattr(doctor, "measures_here", lambda user: ~Measure(0))
    mode, _ = flight_options.mode_of(None, own=False, named=False)
    finding, *_ = doctor._boundary(mode)
    assert finding.verdict is (MissionVerdict.OK if built else MissionVerdict.WARN)
    assert (finding.found == UNBUILT) != built


def test_requested_process_mode_is_required(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("rtshcua.adapters.boundary.process.program", lambda: None)
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["compile", str(library() / "missions" / "short.rts"), "-o", "short.bundle"]) == ExitCode.OK
    words = ["run", "short.bundle", "--mode", "process", "--connect", "udpin:127.0.0.1:14550", "--vehicle", "quad-07"]
    capsys.readouterr()
    assert main(words) == ExitCode.REFUSED
    said = capsys.readouterr().err
    assert "the boundary's program was not built" in said
    assert "`make setup` builds it" in said
