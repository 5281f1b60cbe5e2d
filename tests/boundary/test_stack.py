"""The stack usage of the boundary in C is known, and small."""

import ctypes
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ENTRIES = ("rt_boundary_begin", "rt_answer", "rt_take_back", "rt_give_back", "rt_signed_up_to")


def stack(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(ROOT / ".make" / "stack"), str(folder)], capture_output=True, text=True, check=False
    )


def test_the_stack_is_bounded(boundary: ctypes.CDLL) -> None:
    made = stack(ROOT / "build" / "boundary")
    if "only gcc" in made.stderr:
        pytest.skip("only gcc writes call graphs")
    assert made.returncode == 0, made.stdout + made.stderr


@pytest.mark.parametrize(
    ("frame", "edge", "found"),
    [
        ("40000 bytes (static)", "memcpy", "40,000 octets are more than"),
        ("8 bytes (static)", "rt_answer", "`rt_answer` calls itself"),
        ("8 bytes (static)", "__indirect_call", "`rt_answer` calls by address"),
        ("8 bytes (static)", "malloc", "nor one that may be called: malloc"),
        ("8 bytes (dynamic)", "memcpy", "`rt_answer` has no fixed size"),
    ],
)
def test_unbounded_recursion_is_found(tmp_path: Path, frame: str, edge: str, found: str) -> None:
    sizes = dict.fromkeys(ENTRIES, "8 bytes (static)") | {"rt_answer": frame}
    nodes = [f'node: {{ title: "{name}" label: "{name}\\nx.c:1:1\\n{size}" }}' for name, size in sizes.items()]
    (tmp_path / "objects").mkdir()
    (tmp_path / "objects" / "x.ci").write_text(
        "\n".join([*nodes, f'edge: {{ sourcename: "rt_answer" targetname: "{edge}" label: "x.c:2:1" }}'])
    )
    made = stack(tmp_path)
    assert made.returncode != 0
    assert found in made.stdout + made.stderr
