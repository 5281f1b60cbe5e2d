"""The world that the tests of the editor share is one of no errors."""

from rtshcua.ground.editor.workspace import Workspace
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect


def test_no_errors(desk: Workspace) -> None:
    found = examine_program(desk.view("/w/dip.rts").program, dialect.load()).diagnostics
    assert [each.message for each in found if each.severity.value == "error"] == []
