"""`make dist` is reproducible, and lists all dependencies."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from base64 import b64encode
from importlib import metadata
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

CHECKOUT = Path(__file__).resolve().parents[2]
TAGS = {each: f"manylinux_2_17_{each}.musllinux_1_1_{each}" for each in ("x86_64", "aarch64")}
PRODUCTS = {f"rtshcua-0.1.0-py3-none-{tag}.whl" for tag in ("any", *TAGS.values())} | {"rtshcua.cdx.json"}
FETCHED = "build/boundary/fetched"


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
    shutil.copytree(CHECKOUT / FETCHED, place / FETCHED)  # as set-up left it: pinned by hash
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


#: what is compiled into the program, and who has the rights to it
HOLDERS = {
    "monocypher": "Loup Vaillant", "libsodium": "Colin Percival", "musl": "Rich Felker", "zig-compiler-rt": "Zig",
}  # fmt: skip
COMPILED = HOLDERS.keys()
VENDORED = {"@noble/ed25519"}


@pytest.mark.clients
@pytest.mark.long
@pytest.mark.parametrize("anew", [False, pytest.param(True, marks=pytest.mark.soak)])
def test_make_dist_is_reproducible(tmp_path: Path, anew: bool) -> None:
    """`anew`: the other compiles the C library too."""
    one = copied(tmp_path / "one", stray=False)
    other = copied(tmp_path / "two of them", stray=True)
    for each in other.rglob("*"):
        os.utime(each, (400_000_000, 400_000_000))
        each.chmod(0o700 if each.is_dir() or each.stat().st_mode & 0o100 else 0o600)
    cached = {"ZIG_GLOBAL_CACHE_DIR": str(CHECKOUT / "build" / "zig")}
    first = made(one, 0o022, {"TZ": "UTC"} | cached)
    odd = {"TZ": "Asia/Tokyo", "LC_ALL": "POSIX", "HOME": str(tmp_path), "SOURCE_DATE_EPOCH": "1700000000"}
    assert first.keys() == PRODUCTS
    odd |= {"PYTHONHASHSEED": "7", "USER": "somebody"} | ({} if anew else cached)
    assert made(other, 0o077, odd) == first
    assert made(one, 0o022, cached) == first  # over what is there
    for machine, number in (("x86_64", 62), ("aarch64", 183)):
        with ZipFile(one / f"dist/rtshcua-0.1.0-py3-none-{TAGS[machine]}.whl") as wheel:
            expect_program(wheel, number)


def expect_program(wheel: ZipFile, machine: int) -> None:
    """It may be run on this machine (its number in ELF), needs no C library there, and has all licences with it."""
    info = wheel.getinfo("rtshcua/boundary/rtshcua-boundary")
    assert info.external_attr >> 16 & 0o777 == 0o755
    program = wheel.read(info)
    assert (program[:4], int.from_bytes(program[18:20], "little")) == (b"\x7fELF", machine)
    start, size, count = (int.from_bytes(program[at:to], "little") for at, to in ((32, 40), (54, 56), (56, 58)))
    kinds = {int.from_bytes(program[start + each * size :][:4], "little") for each in range(count)}
    interpreter = 3
    assert interpreter not in kinds
    names = {Path(each).stem: each for each in wheel.namelist() if each.startswith("rtshcua/boundary/licences/")}
    assert names.keys() == COMPILED
    for name, holder in HOLDERS.items():
        assert holder in wheel.read(names[name]).decode()


@pytest.fixture(scope="module")
def bill() -> Any:
    done = subprocess.run([sys.executable, ".make/sbom"], cwd=CHECKOUT, check=True, capture_output=True)
    return json.loads(done.stdout)


def applies(each: Requirement, extras: tuple[str, ...] = ("",)) -> bool:
    return each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in extras)


def packages(bill: Any) -> list[Any]:
    """Its components that are installed with the wheel, neither compiled into it nor copied."""
    return [each for each in bill["components"] if each["name"] not in COMPILED | VENDORED]


@pytest.mark.slow
def test_bill_of_materials_lists_the_compiled_sources(bill: Any) -> None:
    inside = {each["name"]: each for each in bill["components"] if each["name"] in COMPILED}
    assert inside.keys() == COMPILED
    pins = "".join((CHECKOUT / "requirements" / f"{each}.txt").read_text("utf-8") for each in ("boundary", "zig"))
    for each in inside.values():
        package, _, rest = each["purl"].removeprefix("pkg:pypi/").partition("@")
        pin = pins[pins.index(f"{package}=={rest.partition('#')[0]} ") :].split("==")[1]
        assert each["version"]
        assert each["hashes"]
        for value in each["hashes"]:
            assert f"sha256:{value['content']}" in pin
        assert "licenses" in each
    (own,) = [each for each in bill["dependencies"] if each["ref"].startswith("pkg:pypi/rtshcua@")]
    assert {each["bom-ref"] for each in inside.values()} <= {*own["dependsOn"]}
    head = (CHECKOUT / FETCHED / "monocypher.c").read_text("utf-8").splitlines()[0]
    assert head == f"// Monocypher version {inside['monocypher']['version']}"


def test_bill_of_materials_lists_the_vendored_javascript(bill: Any) -> None:
    (one,) = [each for each in bill["components"] if each["name"] in VENDORED]
    ((_, path),) = [each.values() for each in one["properties"]]
    assert (CHECKOUT / path).is_file()
    (row,) = [line for line in (CHECKOUT / path).with_name("README.md").read_text("utf-8").splitlines()
              if f"`{Path(path).name}`" in line]  # fmt: skip
    (digest,) = [each["content"] for each in one["hashes"]]
    integrity = f"sha512-{b64encode(bytes.fromhex(digest)).decode()}"
    licence = one["licenses"][0]["license"]["id"]
    assert f"| {one['version']} | `{integrity}` | {licence}," in row
    assert one["purl"] == f"pkg:npm/%40noble/ed25519@{one['version']}"


def test_bill_of_materials_has_the_pinned_versions(bill: Any) -> None:
    text = (CHECKOUT / "requirements/dev.txt").read_text(encoding="utf-8").replace("\\\n", "")
    pins = [Requirement(line.split("--hash")[0]) for line in text.splitlines() if "==" in line]
    pinned = {canonicalize_name(each.name): str(each.specifier)[2:] for each in pins if applies(each)}
    listed = {each["name"]: each["version"] for each in packages(bill)}
    assert len(listed) == len(packages(bill))
    assert listed == {name: pinned[name] for name in listed} == {name: metadata.version(name) for name in listed}
    assert {each["purl"] for each in packages(bill)} == {f"pkg:pypi/{name}@{it}" for name, it in listed.items()}


def test_bill_of_materials_lists_exactly_the_dependencies(bill: Any) -> None:
    names = {each["bom-ref"]: each["name"] for each in (*bill["components"], bill["metadata"]["component"])}
    edges = {names[each["ref"]]: {names[below] for below in each["dependsOn"]} for each in bill["dependencies"]}
    assert edges.keys() == {*names.values()}
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    always = {canonicalize_name(Requirement(each).name) for each in project["dependencies"]}
    extras = {
        canonicalize_name(Requirement(e).name) for line in project["optional-dependencies"].values() for e in line
    }
    assert edges["rtshcua"] == ((always | extras) - {"rtshcua"}) | COMPILED | VENDORED
    for name, below in edges.items():
        if name not in {"rtshcua", *COMPILED, *VENDORED}:
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
    assert {name for name, scope in scopes.items() if scope == "required"} == reached(always) | COMPILED | VENDORED
