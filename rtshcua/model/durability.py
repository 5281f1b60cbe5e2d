"""How durable a record is to be before anyone acts on it (docs/log-format.md, section 4)."""

from typing import Final

#: taken over by the writer; lost with the process
BUFFERED: Final = 0
#: written: survives the death of the process (kill -9)
WRITTEN: Final = 1
#: on the disk within the time that the genesis states (`sync_us`): survives a loss of power that comes later
SYNCED: Final = 2
#: on the disk before what it permits goes out
SYNCED_FIRST: Final = 3

#: the time within which class 2 is on the disk, in us
SYNC_US: Final = 1_000_000

#: the word for each class, by number, as a `record` clause has it
WORDS: Final = ("buffered", "written", "synced", "synced_first")
