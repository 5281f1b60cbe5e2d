"""What the program of the boundary is compiled from, with licences; and how a wheel gets that program.

`python -m build --wheel` makes a wheel without it. With RTSHCUA_TARGET=x86_64-linux-musl, the program that
.make/boundary built for that target goes in, with the licences of what is linked into it; the
wheel is for that machine alone.
"""

import os
import re
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).resolve().parents[1]
BUILT = ROOT / "build" / "boundary"
FETCHED = BUILT / "fetched"


#: that of zig; a wheel is not made where it is another
MUSL = "1.2.5"


class Compiled(NamedTuple):
    """A library that is linked into the program. `hashes`: of the files that it may be taken from."""

    name: str
    version: str
    licence: str
    purl: str
    hashes: list[str]
    cpe: str = ""


def compiled() -> list[Compiled]:
    """What is linked into the program. Raises OSError where the sources were not fetched."""
    pins = "".join((ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8") for name in ("boundary", "zig"))
    pinned = {
        name: (version, re.findall(r"sha256:(\w+)", hashes))
        for name, version, hashes in re.findall(r"^(\w+)==(\S+)((?: \\\n +--hash=\S+)+)$", pins, re.MULTILINE)
    }
    monocypher = _one(r"^// Monocypher version (\S+)", _read(FETCHED / "monocypher.c"))
    sodium = _one(r"AC_INIT\(\[libsodium\],\[(\S+?)\]", _read(FETCHED / "configure.ac"))
    zig = pinned["ziglang"][0]
    return [
        Compiled(name, version, licence, f"pkg:pypi/{package}@{pinned[package][0]}{below}", pinned[package][1], cpe)
        for name, version, licence, package, below, cpe in (
            ("monocypher", monocypher, "BSD-2-Clause OR CC0-1.0", "pymonocypher", "", ""),
            ("libsodium", sodium, "ISC AND BSD-2-Clause", "pynacl", "#src/libsodium", "libsodium:libsodium"),
            ("musl", MUSL, "MIT", "ziglang", "#lib/libc/musl", "musl-libc:musl"),
            ("zig-compiler-rt", zig, "MIT", "ziglang", "#lib/compiler_rt", ""),
        )
    ]


def licences() -> dict[str, str]:
    """The licence texts of what is linked into the program, by name. Raises OSError where one is not as it was."""
    zig = Path(str(metadata.distribution("ziglang").locate_file("ziglang")))
    musl = zig / "lib" / "libc" / "musl"
    if _one(r'VERSION "(\S+)"', _read(musl / "src" / "internal" / "version.h")) != MUSL:
        raise OSError(f"zig brings another musl than {MUSL}: name it in .make/compiled.py")
    head = _read(FETCHED / "monocypher.c").split("\n\n")[0]
    sodium = (_comment(FETCHED / each) for each in ("LICENSE", "hash_sha256_cp.c", "hash_sha512_cp.c"))
    return {
        "monocypher": re.sub(r"(?m)^//( |$)", "", head),
        "libsodium": "\n\n".join(sodium),
        "musl": _read(musl / "COPYRIGHT"),
        "zig-compiler-rt": _read(zig / "LICENSE"),
    }


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _one(pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    if found is None:
        raise OSError(f"nothing that was fetched matches `{pattern}`")
    return found[1]


def _comment(path: Path) -> str:
    """The comment that a file begins with, without its stars."""
    text = _one(r"(?s)^\s*/\*-?\n(.*?)\*/", _read(path))
    return "\n".join(line.removeprefix(" *").removeprefix(" ").rstrip() for line in text.splitlines())


class WithProgram(BuildHookInterface):
    """Puts the program into the wheel that is made for a target."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it makes a wheel."""
        target = os.environ.get("RTSHCUA_TARGET")
        if target is None or version != "standard":
            return
        machine = target.partition("-")[0]
        # it is linked statically, so it needs no C library of the system: of either kind, as old as Python 3.11 runs on
        build_data["tag"] = f"py3-none-manylinux_2_17_{machine}.musllinux_1_1_{machine}"
        build_data["pure_python"] = False
        inside = {str(BUILT / target / "rtshcua-boundary"): "rtshcua/boundary/rtshcua-boundary"}
        folder = BUILT / target / "licences"
        folder.mkdir(exist_ok=True)
        for name, text in licences().items():
            (folder / f"{name}.txt").write_text(text.strip() + "\n", encoding="utf-8")
            inside[str(folder / f"{name}.txt")] = f"rtshcua/boundary/licences/{name}.txt"
        build_data["force_include"].update(inside)
