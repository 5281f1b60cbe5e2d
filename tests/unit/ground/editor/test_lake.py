"""The sample workspace of the editor tests has no errors."""

from rtshcua.ground.editor.workspace import Workspace
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect


def test_sample_workspace_has_no_errors(desk: Workspace) -> None:
    found = examine_program(desk.view("/w/dip.rts").program, dialect.load()).diagnostics
    assert [each.message for each in found if each.severity.value == "error"] == []
