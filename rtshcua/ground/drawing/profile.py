"""A side profile: the floor and the ceiling of each zone, above home."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rtshcua.ground.drawing.canvas import LETTER, ROUND, WIDTH, LabelBox, hatching
from rtshcua.ground.drawing.drawn_site import Site, ZoneView
from rtshcua.model.quantity import Dimension, display

#: px
_HEIGHT, _TOP, _LEFT, _LINE, _LEAST = 240, 34, 70, 15, 74
#: the height of the drawing above the highest limit, as a share of it
_ABOVE = 4


@dataclass(frozen=True, slots=True)
class Column:
    """A zone: its bar, whether it continues beyond the drawing, and its name in lines."""

    x: float
    width: float
    top: float
    bottom: float
    kind: str
    open_above: bool
    lines: tuple[str, ...]
    title: str
    hatch: str


@dataclass(frozen=True, slots=True)
class Profile:
    """A drawing of columns for a policy; `marks` are heights with their place on the page, `returns` the line of the
    way home.
    """

    policy: str
    width: int
    height: int
    left: int
    ground: float
    columns: tuple[Column, ...]
    marks: tuple[tuple[float, str], ...]
    returns: tuple[float, str] | None


def profiles(site: Site) -> tuple[Profile, ...]:
    """Draw the zones in as many drawings as necessary, all to the same scale."""
    zones = [zone for zone in site.zones if not zone.derived]
    limits = [limit for zone in zones for limit in (zone.floor, zone.ceiling) if limit is not None]
    limits.append(site.return_altitude)
    highest, lowest = max([*limits, 10_000]), min([*limits, 0])
    top = highest + (highest - lowest) // _ABOVE
    fit = (WIDTH - _LEFT - 10) // _LEAST
    groups = [zones[at : at + fit] for at in range(0, len(zones), fit)]
    return tuple(_profile(site.policy, group, lowest, highest, top, site.return_altitude) for group in groups)


def _profile(policy: str, zones: Sequence[ZoneView], lowest: int, highest: int, top: int, returns: int) -> Profile:
    scale = _HEIGHT / (top - lowest)
    base = _TOP + _HEIGHT

    def at(height: int) -> float:
        return base - (height - lowest) * scale

    width = min((WIDTH - _LEFT - 10) / len(zones), 130)
    columns = tuple(_column(zone, _LEFT + number * width, width, at) for number, zone in enumerate(zones))
    most = max(len(column.lines) for column in columns)
    step = _step(highest - lowest)
    first = -(-lowest // step) * step
    marks = tuple((at(height), display(height, Dimension.LENGTH)) for height in range(first, highest + 1, step))
    line = (at(returns), f"return at {display(returns, Dimension.LENGTH)}") if returns else None
    return Profile(policy, WIDTH, round(base) + 12 + _LINE * (most + 1), _LEFT, at(0), columns, marks, line)


def _column(zone: ZoneView, x: float, width: float, at: Callable[[int], float]) -> Column:
    base = _TOP + _HEIGHT
    top = _TOP if zone.ceiling is None else at(zone.ceiling)
    bottom = base if zone.floor is None else at(zone.floor)
    box = LabelBox(x + 8, top, width - 16, bottom - top)
    return Column(
        x=box.x,
        width=box.width,
        top=top,
        bottom=bottom,
        kind=zone.use or "other",
        open_above=zone.ceiling is None,
        lines=_lines(zone.name, int((width - 4) / LETTER)),
        title=f"{zone.name}: {zone.band}",
        hatch=hatching(box, WIDTH, base) if zone.use == "forbidden" else "",
    )


def _lines(name: str, letters: int) -> tuple[str, ...]:
    """Break a name into lines, at `_` if possible."""
    lines: list[str] = []
    for part in name.replace("_", "_\n").split("\n"):
        for start in range(0, len(part), letters):
            piece = part[start : start + letters]
            if lines and len(lines[-1]) + len(piece) <= letters:
                lines[-1] += piece
            else:
                lines.append(piece)
    return tuple(lines)


def _step(span: int) -> int:
    """A round interval, about a sixth of the height."""
    return next(step for step in ROUND if step * 6 >= span)
