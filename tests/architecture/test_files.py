"""Pinned requirements name packages and hashes, but no source."""

import re
import tomllib
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
REQUIREMENTS = sorted((CHECKOUT / "requirements").glob("*.txt"))


def pins(text: str) -> list[str]:
    """Yield the logical lines: continuations joined, without comments and blank lines."""
    lines = (re.sub(r"(^|\s)#.*", "", line).strip() for line in text.replace("\\\n", " ").splitlines())
    return [line for line in lines if line]


@pytest.mark.parametrize("file", REQUIREMENTS, ids=lambda file: file.name)
def test_pins_are_exact_and_hashed_and_name_no_place(file: Path) -> None:
    """A name, `==` and a version, an optional marker, and hashes: no address, path or option matches."""
    pin = re.compile(r"[A-Za-z0-9._-]+==[0-9A-Za-z.!+]+( ; [\w\s.*'<>=!()]+?)?(\s+--hash=sha256:[0-9a-f]{64})+")
    text = file.read_text(encoding="utf-8")
    assert "://" not in text
    assert pins(text)
    assert not [line for line in pins(text) if not pin.fullmatch(line)]


def test_every_declared_dependency_is_pinned() -> None:
    config = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
    declared = [
        *config["project"]["dependencies"],
        *config["dependency-groups"]["dev"],
        *config["build-system"]["requires"],
    ]
    names = {re.split(r"[^\w-]", requirement)[0].lower() for requirement in declared}
    pinned = {line.partition("==")[0] for line in pins((CHECKOUT / "requirements/dev.txt").read_text(encoding="utf-8"))}
    assert not names - pinned
