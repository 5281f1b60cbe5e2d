"""The computer that measures: what the report prints beside the platform of the published figures."""

import os
import platform
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

import msgspec

from rtshcua import __version__
from rtshcua.adapters.store.git import checkout_commit
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evaluation.results import Natural

#: the libraries whose versions are printed
LIBRARIES: Final = ("cryptography", "msgspec", "pymavlink", "shapely")
_CHECKOUT: Final = Path(__file__).resolve().parents[2]


class Computer(msgspec.Struct, frozen=True, kw_only=True):
    """A computer and the program on it. `memory` in bytes, `load` the averages of 1, 5 and 15 minutes, `versions` by
    name; what the system does not tell is empty or None.
    """

    processor: str
    cores: Natural
    memory: Natural | None
    system: str
    python: str
    program: str
    commit: str
    versions: dict[str, str]
    load: tuple[float, ...]

    @property
    def described(self) -> str:
        """The computer and its software, without its load."""
        memory = "unknown memory" if self.memory is None else f"{self.memory / 2**30:.1f} GiB"
        libraries = (f"{name} {number}" for name, number in sorted(self.versions.items()))
        return "; ".join((self.processor, f"{self.cores} usable cores", memory, self.system, self.python, *libraries))


def this_computer() -> Computer:
    """Describe this computer now."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Computer(
        processor=_processor(),
        cores=usable,
        memory=_memory(),
        system=_system(),
        python=f"{platform.python_implementation()} {platform.python_version()}",
        program=__version__,
        commit=checkout_commit(_CHECKOUT) or "",
        versions=dict(_versions()),
        load=tuple(round(each, 2) for each in os.getloadavg()) if hasattr(os, "getloadavg") else (),
    )


def _processor() -> str:
    """The model of the processor, as Linux names it."""
    try:
        with open_regular("/proc/cpuinfo") as file:
            lines = file.read().decode(errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or platform.machine()


def _memory() -> int | None:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def _system() -> str:
    """The name of the system's release, and its kernel."""
    kernel = f"{platform.system()} {platform.release()}"
    try:
        return f"{platform.freedesktop_os_release()['PRETTY_NAME']}, {kernel}"
    except (OSError, KeyError):
        return kernel


def _versions() -> Iterator[tuple[str, str]]:
    for name in LIBRARIES:
        try:
            yield name, version(name)
        except PackageNotFoundError:
            continue
