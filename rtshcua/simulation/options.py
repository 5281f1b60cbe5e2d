"""The command line of the simulated vehicle's process."""

import argparse
from collections.abc import Callable
from pathlib import Path

from rtshcua.mavlink.signing import KEY_OCTETS
from rtshcua.simulation.config import HOME, Boot, Kind, SimulationConfig
from rtshcua.simulation.fault_text import parse_fault
from rtshcua.simulation.place import Home
from rtshcua.simulation.wind import Wind


def parser() -> argparse.ArgumentParser:
    """The options; each is checked on its own, with a message for a person."""
    options = argparse.ArgumentParser(prog="python -m rtshcua.simulation", description="A simulated multirotor.")
    add = options.add_argument
    add("--port", type=_number(int, 1, 65_535), required=True, help="UDP port on loopback that is sent to, and heard")
    add("--bind", type=_number(int, 0, 65_535), default=0, help="own UDP port; 0 (default) takes a free one")
    add("--flavour", choices=list(Kind), default=Kind.PX4)
    add("--system", type=_number(int, 1, 255), default=1, help="MAVLink system id")
    add("--speed", type=_number(float, 0.01, 200), default=1.0, help="seconds of flight in a second")
    add("--seed", type=int, default=1)
    add(
        "--home",
        type=_listed("LAT,LON,AMSL", 3, 3),
        help="degrees, degrees, metres above the sea; south: --home=-35.3,149.1,584",
    )
    add("--battery", type=_number(float, 0, 100), default=100.0, help="%% at the start")
    add("--hover", type=_number(float, 0.1, 600), default=18.0, help="minutes that a full battery hovers")
    add("--cruise", type=_number(float, 0.1, 12), default=5.0, help="m/s")
    add("--return-at", type=_number(float, 2, 1000), default=30.0, help="metres above home that a return climbs to")
    add("--wind", type=_listed("SPEED,FROM[,GUST]", 2, 3), default=[0.0, 0.0], help="m/s, degrees, m/s")
    add("--no-noise", action="store_true", help="sensors without noise")
    add("--boot", choices=list(Boot), default=Boot.FAST, help="how sensors come up: in a second, or as recorded")
    add("--signing-key", type=_key, metavar="FILE", help="the link's key: 32 octets, or as many in hexadecimal")
    add("--usb", action="store_true", help="the vehicle takes the link for USB: it obeys without signatures")
    add("--fault", type=_fault, action="append", default=[], metavar="KIND,at=TIME,...", help="may be repeated")
    return options


def config_of(options: argparse.Namespace, utc_us: int = 0) -> SimulationConfig:
    """The configuration that the options ask for; `utc_us` is the present. Raises ValueError where they do not fit."""
    speed, from_deg, *gust = options.wind
    home = HOME
    if options.home is not None:
        latitude, longitude, amsl = options.home
        home = Home(round(latitude * 10_000_000), round(longitude * 10_000_000), round(amsl * 1000))
    return SimulationConfig(
        flavour=Kind(options.flavour),
        system=options.system,
        home=home,
        battery=round(options.battery * 100),
        hover_us=round(options.hover * 60_000_000),
        cruise_mm_s=round(options.cruise * 1000),
        return_mm=round(options.return_at * 1000),
        wind=Wind(round(speed * 1000), round(from_deg), round(gust[0] * 1000) if gust else 0),
        seed=options.seed,
        noise=not options.no_noise,
        boot=Boot(options.boot),
        faults=tuple(options.fault),
        signing_key=options.signing_key,
        usb=options.usb,
        utc_us=utc_us,
        speed=max(1, round(options.speed * 100)),
    )


def _number(kind: type[int] | type[float], low: float, high: float) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = kind(low) - 1
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"`{text}` is not a number from {low} to {high}")
        return value

    return parse


def _listed(shape: str, least: int, most: int) -> Callable[[str], list[float]]:
    def parse(text: str) -> list[float]:
        try:
            values = [float(part) for part in text.split(",")]
        except ValueError:
            values = []
        if not least <= len(values) <= most or not all(abs(value) < 1e6 for value in values):
            raise argparse.ArgumentTypeError(f"`{text}` is not {shape}")
        return values

    return parse


def _key(text: str) -> bytes:
    try:
        data = Path(text).read_bytes()
    except OSError as error:
        raise argparse.ArgumentTypeError(f"cannot read `{text}`: {(error.strerror or str(error)).lower()}") from None
    if len(data) != KEY_OCTETS:
        try:
            data = bytes.fromhex(data.decode("ascii"))
        except ValueError:
            data = b""
    if len(data) != KEY_OCTETS:
        raise argparse.ArgumentTypeError(f"`{text}` holds no key of {KEY_OCTETS} octets")
    return data


def _fault(text: str) -> object:
    try:
        return parse_fault(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
