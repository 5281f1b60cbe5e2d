"""The number of a step, as people and agents know it: the first step of a mission is step 1.

Wire formats and records of logs hold the index of a step, from 0 (`step`). Whatever a person or an agent reads or types
is its number, from 1: in texts, on command lines, and as `step_number` in JSON.
"""


def number_of(index: int) -> int:
    """The number of the step of this index."""
    return index + 1


def index_of(number: int) -> int:
    """The index of the step of this number."""
    return number - 1


def step_words(index: int) -> str:
    """The step of this index in words: `step 1` for index 0."""
    return f"step {number_of(index)}"
