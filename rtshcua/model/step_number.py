"""The number of a step for people and agents: the first step of a mission is step 1.

Wire formats and records of logs contain the index of a step, from 0 (`step`). Texts, command lines, and
`step_number` in JSON use its number, from 1.
"""


def number_of(index: int) -> int:
    """The number of the step of this index."""
    return index + 1


def index_of(number: int) -> int:
    """The index of the step of this number."""
    return number - 1


def step_words(index: int) -> str:
    """The text `step 1` for index 0."""
    return f"step {number_of(index)}"
