"""What a mission takes at most, in one line."""

from rtshcua.ground.compiler.bounds import Bounds, rounded_energy, rounded_time


def bounds_told(bounds: Bounds) -> str:
    """The line for a person; times rounded up to the second, energy to the percent."""
    steps = f"{bounds.invocations} step{'s' * (bounds.invocations != 1)}"
    time, energy = rounded_time(bounds.time_us), rounded_energy(bounds.energy)
    return f"at most {steps}, {time} from issue to end, {energy} of a full charge"
