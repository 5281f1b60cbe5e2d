"""Addresses of links, as options give them."""

from collections.abc import Collection

from rtshcua.adapters.vehicle.address import Address, AddressError, LinkCarrier, parse
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import misaddressed


def address_of(
    text: str, option: str = "--connect", ways: Collection[LinkCarrier] = tuple(LinkCarrier)
) -> Address | ExitCode:
    """The address in the value of an option; an exit code where it is wrong, told."""
    try:
        return parse(text, ways)
    except AddressError as error:
        return misaddressed(option, error)
