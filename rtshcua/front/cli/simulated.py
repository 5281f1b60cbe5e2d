"""The options of the simulated vehicle, as `run` and `sim` share them."""

import re
from typing import Annotated

import typer

from rtshcua.model.faults import WindStep
from rtshcua.model.flat.policy import Policy
from rtshcua.simulation.config import AutopilotKind
from rtshcua.simulation.fault_syntax import OF_VEHICLE, parse_fault

_BARE = re.compile(r"\d+(\.\d+)?", re.ASCII)
_WIND = ("speed", "m/s"), ("from", "deg"), ("gust", "m/s")
_RELEASE = re.compile(r"\d{1,2}\.\d{1,2}", re.ASCII)
_HOME = re.compile(r"-?\d+(\.\d+)?,-?\d+(\.\d+)?,-?\d+(\.\d+)?", re.ASCII)


def _wind(text: str | None) -> str | None:
    """The wind as the simulated vehicle takes it, without units; a number without one is in m/s or degrees."""
    if text is None:
        return None
    parts = text.split(",")
    try:
        if not 2 <= len(parts) <= 3 or any(part.startswith("-") for part in parts):
            raise ValueError("two or three numbers that are not below zero are needed")
        words = (
            f"{name}={part}{unit if _BARE.fullmatch(part) else ''}"
            for (name, unit), part in zip(_WIND, parts, strict=False)
        )
        wind = parse_fault(",".join(("wind,at=0s", *words)))
    except ValueError as error:
        raise typer.BadParameter(f"`{text}` is not SPEED,FROM[,GUST], as in 6m/s,270deg,2m/s: {error}") from None
    assert isinstance(wind, WindStep)
    return f"{wind.speed_mm_s / 1000:g},{wind.from_deg},{wind.gust_mm_s / 1000:g}"


def release(text: str | None) -> str | None:
    """The callback of an option for a release: it is two numbers."""
    if text is not None and not _RELEASE.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is no release, such as 1.18")
    return text


def _home(text: str | None) -> str | None:
    if text is not None and not _HOME.fullmatch(text):
        raise typer.BadParameter(f"`{text}` is not LAT,LON,AMSL in degrees, degrees and metres")
    return text


def _faults(texts: list[str] | None) -> list[str] | None:
    for text in texts or []:
        try:
            parse_fault(text)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
    return texts


Flavour = Annotated[AutopilotKind | None, typer.Option(help="which autopilot the simulated vehicle is (px4)")]
Battery = Annotated[float | None, typer.Option(min=0, max=100, metavar="PERCENT", help="its charge at the start (100)")]
Wind = Annotated[
    str | None,
    typer.Option(
        metavar="SPEED,FROM[,GUST]", callback=_wind, help="such as 6m/s,270deg,2m/s: the mean, from where, gusts"
    ),
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault", metavar="KIND,at=TIME,...", callback=_faults,
        help=f"what goes wrong (repeatable): {', '.join(OF_VEHICLE)}; such as battery,at=30s,level=20%",
    ),
]  # fmt: skip
Home = Annotated[
    str | None, typer.Option(metavar="LAT,LON,AMSL", callback=_home, help="where it stands: degrees, degrees, metres")
]
Seed = Annotated[int | None, typer.Option(help="of its noise and gusts: the same seed, the same vehicle (1)")]


def arguments(
    *,
    flavour: AutopilotKind | None,
    battery: float | None,
    wind: str | None,
    faults: list[str] | None,
    seed: int | None,
) -> list[str]:
    """The command line of the simulation's process; options left out keep its own defaults."""
    words: list[str] = []
    for name, value in (("flavour", flavour), ("battery", battery), ("wind", wind), ("seed", seed)):
        if value is not None:
            words += [f"--{name}", str(value)]
    for fault in faults or []:
        words += ["--fault", fault]
    return words


def of_policy(policy: Policy) -> list[str]:
    """Options that make it the vehicle of a policy: its home, its endurance, its return, no faster, what it reads."""
    from rtshcua.virtual.fitting import fitting  # the simulation's parameters, which a flight of another vehicle lacks

    fits = fitting(policy)
    home = fits.home
    return [
        f"--return-at={fits.return_mm / 1_000:g}",
        f"--home={home.latitude / 1e7:.7f},{home.longitude / 1e7:.7f},{home.amsl_mm // 1_000}",
        f"--hover={fits.hover_us / 60_000_000:.3f}",
        f"--cruise={fits.cruise_mm_s / 1_000:.3f}",
        *(sorted(f"--extra={extra}" for extra in fits.extras) or ["--stock"]),
    ]
