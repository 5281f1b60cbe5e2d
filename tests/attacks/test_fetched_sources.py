"""Threat: a source distribution that the boundary is built from contains setup code, or is not the pinned one.

Outcomes: none of its code runs and nothing else is fetched; a distribution that is not pinned is not unpacked.
"""

import hashlib
import io
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any, NamedTuple

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SCRIPT = CHECKOUT / ".make" / "monocypher"
PINNED = {"pymonocypher": "9.8.7", "pynacl": "6.5.4"}
BACK_ENDS = {"pymonocypher": "", "pynacl": 'build-backend = "setuptools.build_meta"'}


def distribution(folder: Path, name: str, mark: Path, files: Any) -> str:
    """A source distribution whose setup code leaves a mark, and which requires a package that does not exist; and its
    hash.
    """
    top = f"{name}-{PINNED[name]}"
    texts = {each: f"/* {each} */" for each in files}
    texts["PKG-INFO"] = f"Metadata-Version: 2.1\nName: {name}\nVersion: {PINNED[name]}\n"
    texts["setup.py"] = f"open({str(mark)!r}, 'w').close()\n"
    texts["pyproject.toml"] = f'[build-system]\nrequires = ["rtshcua-never-there"]\n{BACK_ENDS[name]}\n'
    path = folder / f"{top}.tar.gz"
    with tarfile.open(path, "w:gz") as tar:
        for each, text in texts.items():
            info = tarfile.TarInfo(f"{top}/{each}")
            info.size = len(text.encode())
            tar.addfile(info, io.BytesIO(text.encode()))
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def files() -> Any:
    """The unpacked files of each distribution: two constants of the script, which runs when it is imported."""
    source = SCRIPT.read_text(encoding="utf-8")
    found: dict[str, Any] = {}
    exec(source[source.index("SODIUM =") : source.index("def unpacked")], found)
    return found["FILES"]


def fetch(place: Path, links: Path, pins: dict[str, str]) -> "subprocess.CompletedProcess[str]":
    """Unpack the distributions with these hashes, from a local folder only."""
    for folder in (".make", "requirements"):
        (place / folder).mkdir(parents=True, exist_ok=True)
    shutil.copy(SCRIPT, place / ".make")
    lines = [f"{name}=={PINNED[name]} \\\n    --hash=sha256:{value}\n" for name, value in pins.items()]
    (place / "requirements" / "boundary.txt").write_text("".join(lines))
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    environment |= {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(links), "PIP_CONFIG_FILE": os.devnull}
    command = [sys.executable, str(place / ".make" / "monocypher")]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


class Fetched(NamedTuple):
    """A checkout with both distributions: their source, their hashes, and the mark of setup code that ran."""

    place: Path
    links: Path
    pins: dict[str, str]
    mark: Path


@pytest.fixture(scope="module")
def fetched(tmp_path_factory: pytest.TempPathFactory, files: Any) -> Fetched:
    top = tmp_path_factory.mktemp("fetched")
    made = Fetched(top / "one", top / "links", {}, top / "ran")
    made.links.mkdir()
    made.pins.update((name, distribution(made.links, name, made.mark, files[name])) for name in PINNED)
    done = fetch(made.place, made.links, made.pins)
    assert done.returncode == 0, done.stdout + done.stderr
    return made


@pytest.mark.slow
def test_setup_code_of_fetched_package_is_not_run(fetched: Fetched, tmp_path: Path) -> None:
    place, links, pins, mark = fetched
    assert not mark.exists()
    unpacked = place / "build" / "boundary" / "fetched"
    assert (unpacked / "monocypher.c").read_text() == "/* monocypher.c */"
    assert (unpacked / "private" / "common.h").exists()
    for name in PINNED:
        refused = fetch(tmp_path / f"other-{name}", links, pins | {name: "0" * 64})
        assert refused.returncode != 0
        assert "hash" in refused.stdout + refused.stderr.lower()
        assert not (tmp_path / f"other-{name}" / "build" / "boundary" / "fetched").exists()
    assert not mark.exists()


@pytest.mark.slow
def test_missing_source_is_fetched_again(fetched: Fetched, tmp_path: Path) -> None:
    place = tmp_path / "another"
    shutil.copytree(fetched.place, place)
    unpacked = place / "build" / "boundary" / "fetched"
    (unpacked / "configure.ac").unlink()
    assert fetch(place, fetched.links, fetched.pins).returncode == 0
    assert (unpacked / "configure.ac").exists()
    assert fetch(place, tmp_path / "nowhere", fetched.pins).returncode == 0, "it is all there"
