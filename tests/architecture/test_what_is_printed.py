"""All output of commands passes `front/cli/stdout.py` or `front/cli/faults.py`; the exceptions are listed here."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from virtual.rows import rows

PACKAGE = Path(__file__).resolve().parents[2] / "rtshcua"

#: modules that write to a standard stream directly, with the reason why untrusted text cannot reach it unescaped
ALLOWED = {
    "front/lsp/prover.py": "logs, of a process whose standard error an editor reads",
    "front/lsp/server.py": "speaks the protocol, and logs",
    "front/cli/commands/approve.py": "asks; the question passes `visible`",
    "front/cli/app.py": "the version and the overview: our own words",
    "front/cli/commands/archive.py": "a count",
    "front/cli/render/archive_tables.py": "a CSV writer; each text passed `visible`",
    "front/cli/commands/bench.py": "counts, and names of ours",
    "front/cli/commands/campaign.py": "counts, and slugs of ours",
    "front/cli/render/claims.py": "in colour; each line passes `visible`",
    "front/cli/commands/completion.py": "a script for a shell: our own words",
    "front/cli/commands/doctor.py": "a count of seconds",
    "front/cli/commands/explain.py": "a page that ships, in colour",
    "front/cli/faults.py": "errors; each line passes `visible`",
    "front/cli/commands/fmt.py": "gives the standard input back, laid out, octet for octet",
    "front/cli/commands/keys.py": "asks for a passphrase in our own words",
    "front/cli/render/live/__main__.py": "lines of `live/lines.py`, each of which passes `visible` or `escaped`",
    "front/cli/render/live/screen.py": "in colour; each text passes `visible`",
    "front/cli/render/progress.py": "passes `visible`; a bar of our own words",
    "front/cli/stdout.py": "the door",
    "front/cli/unlock.py": "asks for a passphrase, by the duty of its key",
    "simulation/process.py": "a process of its own: its ready line is JSON in ASCII, its options are ours",
}
PRINTING = {
    "print",
    "echo",
    "secho",
    "Console",
    "StreamHandler",
    "basicConfig",
    "confirm",
    "prompt",
    "getpass",
    "input",
}
STREAMS = ("sys.stdout", "sys.stderr", "sys.__stdout__", "sys.__stderr__")
#: uses that only read a stream's properties
HARMLESS = {"isatty", "flush", "fileno", "reconfigure"}
WORDS = re.compile(rf"\b(?:{'|'.join(PRINTING)})\s*\(|sys\.(?:__)?std(?:out|err)")


def printing(source: str) -> Iterator[str]:
    """Yield every way in which a module writes to a standard stream."""
    if not WORDS.search(source):
        return
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        if called.rsplit(".", 1)[-1] in PRINTING:
            yield called
        if called.startswith(STREAMS) and called.rsplit(".", 1)[-1] not in HARMLESS:
            yield called
        yield from (f"{called}({text})" for each in node.args if (text := ast.unparse(each)).startswith(STREAMS)
                    and text.count(".") == 1 and called not in ("isinstance", "getattr"))  # fmt: skip


@rows(
    "way",
    [
        "print(name)", "print(name, file=sys.stderr)", "sys.stdout.write(name)", "sys.stdout.buffer.write(data)",
        "csv.writer(sys.stdout)", "typer.echo(name)", "Console(stderr=True).print(name)",
        "sys.stderr.writelines(names)",
    ],
)  # fmt: skip
def test_scan_finds_every_way_to_print(way: str) -> None:
    assert [*printing(f"def f():\n    {way}\n")]


@rows("way", ["sys.stdout.isatty()", "out(name)", "sys.stdout.flush()", "isinstance(sys.stdout, TextIOWrapper)"])
def test_scan_ignores_other_calls(way: str) -> None:
    assert not [*printing(way)]


def test_all_output_passes_the_stdout_module() -> None:
    found = {
        path.relative_to(PACKAGE).as_posix(): sorted({*printing(path.read_text(encoding="utf-8"))})
        for path in PACKAGE.rglob("*.py")
    }
    stray = {name: ways for name, ways in found.items() if ways and name not in ALLOWED}
    assert not stray, f"printed past `rtshcua/front/cli/stdout.py`: {stray}"
    idle = sorted(name for name in ALLOWED if not found.get(name))
    assert not idle, f"these print nothing themselves any more: {idle}"
