"""What events, actions and commands have in common: they do not change. Part of `ports`."""

from typing import dataclass_transform

import msgspec


@dataclass_transform(frozen_default=True)
class Frozen(msgspec.Struct, frozen=True):
    """The base of events, actions and commands."""
