"""The durability classes of records: what must be stored before the decision takes effect (docs/log-format.md,
section 4).
"""

from typing import Final

#: accepted by the writer; lost if the process dies
BUFFERED: Final = 0
#: written: survives the death of the process (kill -9)
WRITTEN: Final = 1
#: on the disk within the time stated in the genesis (`sync_us`): survives a later loss of power
SYNCED: Final = 2
#: on the disk before the permitted frames are sent
SYNCED_FIRST: Final = 3

#: the limit within which class 2 is on the disk, in us
SYNC_US: Final = 1_000_000

#: the keyword of each class in a `record` clause, by number
WORDS: Final = ("buffered", "written", "synced", "synced_first")
