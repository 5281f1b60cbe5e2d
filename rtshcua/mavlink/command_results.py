"""The results of commands, MAV_RESULT (https://mavlink.io/en/messages/common.html)."""

from typing import Final

ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
FAILED: Final = 4
IN_PROGRESS: Final = 5
CANCELLED: Final = 6
