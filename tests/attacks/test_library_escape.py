"""An agent can import shipped files only: no path out of the library leads to a policy of its own."""

import json
from pathlib import Path

from rtshcua.ground.agent.specification import load_specification
from rtshcua.ground.language.load import load
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[2]
PROPOSAL = json.loads((CHECKOUT / "missions" / "proposal.json").read_text(encoding="utf-8"))

ESCAPES = [
    "lib:../agent/loose.rts",
    "lib:policies/../../agent/loose.rts",
    "lib:policies/../agent/loose.rts",
    "lib:./policies/loose.rts",
    "lib:policies//loose.rts",
    "lib:/etc/passwd",
    "lib:../../../etc/passwd",
    "lib:policies\\..\\loose.rts",
]


def reading(read: list[str], proposal: bytes = b"") -> object:
    def bytes_of(path: str) -> bytes:
        read.append(path)
        return proposal if path == "proposal.json" else Path(path).read_bytes()

    return bytes_of


@rows("path", [*ESCAPES, "lib:agent/loose.rts", "lib:tests/loose.rts", "lib:loose.rts"])
def test_a_specification_imports_from_the_shelves_of_the_library_only(path: str) -> None:
    read: list[str] = []
    text = json.dumps(PROPOSAL | {"imports": [path]}).encode()
    program, _ = load_specification("proposal.json", [], reading(read, text), str(CHECKOUT))
    assert "E0109" in {each.code.id for each in program.diagnostics}
    assert read == ["proposal.json"]


@rows("path", ESCAPES)
@rows("what", ['import "{}"', 'zone yard from "{}"'])
def test_no_source_leaves_the_library(path: str, what: str) -> None:
    read: list[str] = []

    def bytes_of(name: str) -> bytes:
        read.append(name)
        return what.format(path.replace("\\", "/")).encode()

    program = load(["a.rts"], bytes_of, str(CHECKOUT))
    assert [each.code.id for each in program.diagnostics] == ["E0109"]
    assert read == ["a.rts"]


def test_shipped_library_is_imported() -> None:
    read: list[str] = []
    text = json.dumps(PROPOSAL).encode()
    program, _ = load_specification("proposal.json", [], reading(read, text), str(CHECKOUT))
    assert program.diagnostics == ()
    assert len(read) > 2
