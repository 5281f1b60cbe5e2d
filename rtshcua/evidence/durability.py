"""How durable a record is to be before anyone acts on it (docs/log-format.md, section 4)."""

from typing import Final

from rtshcua.model.durability import BUFFERED as BUFFERED
from rtshcua.model.durability import SYNCED as SYNCED
from rtshcua.model.durability import SYNCED_FIRST as SYNCED_FIRST
from rtshcua.model.durability import WORDS as WORDS
from rtshcua.model.durability import WRITTEN as WRITTEN

#: the time within which class 2 is on the disk, in us
SYNC_US: Final = 1_000_000
