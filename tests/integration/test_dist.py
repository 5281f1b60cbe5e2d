"""What `make dist` builds can be built again by anybody: the same bytes, and all that it needs is listed."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

CHECKOUT = Path(__file__).resolve().parents[2]
PRODUCTS = {"rtshcua-0.1.0-py3-none-any.whl", "rtshcua.cdx.json"}


def copied(place: Path, *, stray: bool) -> Path:
    """The checkout as it is now, in another folder; with strays, files lie about that are no part of it."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=CHECKOUT, check=True, capture_output=True, text=True,
    )  # fmt: skip
    for name in filter(None, listed.stdout.split("\0")):
        if (CHECKOUT / name).is_file() and name != ".venv":
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(CHECKOUT / name, place / name)
            shutil.copymode(CHECKOUT / name, place / name)
    for folder in ("rtshcua/__pycache__", "build/lib/rtshcua", "dist"):
        if stray:
            (place / folder).mkdir(parents=True)
            (place / folder / "stray.pyc").write_bytes(b"stray")
    return place


def made(place: Path, mask: int, more: dict[str, str]) -> dict[str, bytes]:
    subprocess.run(
        ["make", "--old-file=setup", f"BIN={Path(sys.executable).parent}", "dist"],
        cwd=place, check=True, capture_output=True, umask=mask, env=os.environ | more,
    )  # fmt: skip
    return {each.name: each.read_bytes() for each in (place / "dist").iterdir() if each.suffix != ".pyc"}


@pytest.mark.clients
def test_make_dist_gives_the_same_bytes_whoever_runs_it_where_and_when(tmp_path: Path) -> None:
    one = copied(tmp_path / "one", stray=False)
    other = copied(tmp_path / "two of them", stray=True)
    for each in other.rglob("*"):
        os.utime(each, (400_000_000, 400_000_000))
        each.chmod(0o700 if each.is_dir() or each.stat().st_mode & 0o100 else 0o600)
    first = made(one, 0o022, {"TZ": "UTC"})
    odd = {"TZ": "Asia/Tokyo", "LC_ALL": "POSIX", "HOME": str(tmp_path), "SOURCE_DATE_EPOCH": "1700000000"}
    assert first.keys() == PRODUCTS
    assert made(other, 0o077, odd | {"PYTHONHASHSEED": "7", "USER": "somebody"}) == first
    assert made(one, 0o022, {}) == first  # over what is there


@pytest.fixture(scope="module")
def bill() -> Any:
    done = subprocess.run([sys.executable, ".make/sbom"], cwd=CHECKOUT, check=True, capture_output=True)
    return json.loads(done.stdout)


def applies(each: Requirement, extras: tuple[str, ...] = ("",)) -> bool:
    return each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in extras)


def test_the_bill_of_materials_has_the_versions_that_are_pinned_and_installed(bill: Any) -> None:
    text = (CHECKOUT / "requirements/dev.txt").read_text(encoding="utf-8").replace("\\\n", "")
    pins = [Requirement(line.split("--hash")[0]) for line in text.splitlines() if "==" in line]
    pinned = {canonicalize_name(each.name): str(each.specifier)[2:] for each in pins if applies(each)}
    listed = {each["name"]: each["version"] for each in bill["components"]}
    assert len(listed) == len(bill["components"])
    assert listed == {name: pinned[name] for name in listed} == {name: metadata.version(name) for name in listed}
    assert {each["purl"] for each in bill["components"]} == {f"pkg:pypi/{name}@{it}" for name, it in listed.items()}


def test_the_bill_of_materials_lists_what_is_needed_and_nothing_else(bill: Any) -> None:
    names = {each["bom-ref"]: each["name"] for each in (*bill["components"], bill["metadata"]["component"])}
    edges = {names[each["ref"]]: {names[below] for below in each["dependsOn"]} for each in bill["dependencies"]}
    assert edges.keys() == {*names.values()}
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    always = {canonicalize_name(Requirement(each).name) for each in project["dependencies"]}
    extras = {
        canonicalize_name(Requirement(e).name) for line in project["optional-dependencies"].values() for e in line
    }
    assert edges["rtshcua"] == (always | extras) - {"rtshcua"}
    for name, below in edges.items():
        if name != "rtshcua":
            lines = [Requirement(each) for each in metadata.requires(name) or ()]
            assert {canonicalize_name(each.name) for each in lines if applies(each)} <= below

    def reached(start: set[str]) -> set[str]:
        found: set[str] = set()
        while start:
            found |= start
            start = set().union(*(edges[each] for each in start)) - found
        return found

    scopes = {each["name"]: each["scope"] for each in bill["components"]}
    assert scopes.keys() == reached(set(edges["rtshcua"]))
    assert {name for name, scope in scopes.items() if scope == "required"} == reached(always)
