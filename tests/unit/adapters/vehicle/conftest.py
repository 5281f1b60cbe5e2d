"""A driver that flies the simulated vehicle in virtual time, with no runtime above it."""

from collections.abc import Callable

import pytest

from virtual.copying import copied
from virtual.flyer import Flyer, climbed


@pytest.fixture(params=["px4", "ardupilot"])
def flavour(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


@pytest.fixture
def flyer(flavour: str) -> Callable[..., Flyer]:
    return lambda **config: Flyer(flavour, **config)


@pytest.fixture
def aloft(flavour: str) -> Callable[..., Flyer]:
    """A function that makes a flying vehicle at 20 m, or at an altitude in mm."""
    return lambda altitude=20_000: copied(climbed(flavour, altitude))
