"""Packs of skills that Python packages bring, found by their entry points; what ships comes through the same door.

A package that brings a pack declares

    [project.entry-points."rtshcua.skills"]
    acme = "acme_skills:folder"                   # gives the folder that `acme:` stands for in an import

and, where a skill of it is to be flown in a way of its own, for each autopilot

    [project.entry-points."rtshcua.manoeuvres"]
    "px4.spray_area" = "acme_skills.px4:stages"   # (Command, Observed, system) -> list[Stage]

`px4` alone, without a skill, is how that autopilot flies whatever has no way of its own: what ships declares it. A
manoeuvre is taken from a package only if the signed policy was compiled from sources in that package's pack, so that
whoever signs the policy says whose code may fly; and whatever it sends still passes the frame session of the command,
which lets nothing through but that command's own targets.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from errno import ENOENT
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from rtshcua.adapters.vehicle.flavour import Stages

SKILLS, MANOEUVRES = "rtshcua.skills", "rtshcua.manoeuvres"
#: the shipped pack: stages for whole flavours come from its package alone
SHIPPED = "lib"

_NAME = re.compile(r"([a-z][a-z0-9_-]+):", re.ASCII)


class BrokenPack(OSError):
    """An installed pack that cannot be used, or is installed twice; the text is for people."""

    def __init__(self, text: str) -> None:
        super().__init__(ENOENT, text)
        self.text = text


@cache
def folder(pack: str) -> str | None:
    """The folder that `pack:` stands for; None where no installed package provides it. Raises `BrokenPack`."""
    found = [point for point in entry_points(group=SKILLS) if point.name == pack]
    if not found:
        return None
    if len(found) > 1:
        raise BrokenPack(f"the pack `{pack}` is provided by {_packages(found)}; keep one of them")
    given = _load(found[0])
    place = given() if callable(given) else given
    if not isinstance(place, str | Path) or not Path(place).is_dir():
        raise BrokenPack(f"the pack `{pack}` of {_packages(found)} provides `{place}`, which is not a folder")
    return str(place)


def packs_of(sources: Iterable[str]) -> frozenset[str]:
    """The packs that a policy was compiled from, by the names of its sources."""
    return frozenset(match[1] for source in sources if (match := _NAME.match(source)))


@cache  # reading the metadata of some hundred packages takes longer than the rest of a flight's start
def manoeuvres(packs: frozenset[str]) -> Mapping[str, Stages]:
    """The stages by flavour (`px4`) and by flavour and skill (`px4.spray_area`), from the shipped pack and these packs.
    Raises `BrokenPack`: a skill with its own stages is not flown in another way because these are broken.
    """
    table: dict[str, Stages] = {}
    for point in _allowed(packs):
        if point.name in table:
            raise BrokenPack(f"`{point.name}` is provided by two packages, one of them {_packages([point])}")
        stages = _load(point)
        if not callable(stages):
            raise BrokenPack(f"`{point.name}` of {_packages([point])} is not a function")
        table[point.name] = stages
    return table


def _allowed(packs: frozenset[str]) -> Iterator[EntryPoint]:
    owners = {_owner(point): point.name for point in entry_points(group=SKILLS) if point.name in packs | {SHIPPED}}
    for point in entry_points(group=MANOEUVRES):
        pack = owners.get(_owner(point))
        if pack is not None and ("." in point.name or pack == SHIPPED):
            yield point


def _owner(point: EntryPoint) -> str:
    return "" if point.dist is None else point.dist.name


def _packages(points: Iterable[EntryPoint]) -> str:
    return " and ".join(f"the package `{_owner(point)}`" for point in points)


def _load(point: EntryPoint) -> Any:
    try:
        return point.load()
    except Exception as error:  # third-party code may raise anything
        raise BrokenPack(f"`{point.name}` of {_packages([point])} cannot be loaded: {error}") from error
