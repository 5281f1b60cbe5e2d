"""The proved bounds of a mission as text and as JSON."""

from rtshcua.ground.prove.mission_bounds import Bounds, rounded_energy, rounded_time


def steps_told(bounds: Bounds) -> list[str]:
    """Return one line for each step with its proved bounds on time and charge."""
    return [
        f"  {number} {each.skill}: at most {rounded_time(each.time_us)}, {each.energy / 100:.1f} % of a full charge"
        for number, each in enumerate(bounds.steps, 1)
    ]


def bounds_dict(bounds: Bounds) -> dict[str, object]:
    """Return the bounds as a JSON object."""
    return bounds._asdict() | {
        "steps": [{"step_number": number} | each._asdict() for number, each in enumerate(bounds.steps, 1)]
    }


def bounds_told(bounds: Bounds) -> str:
    """Return the bounds as one line, time rounded up to the second and energy to the percent."""
    steps = f"{bounds.invocations} step{'s' * (bounds.invocations != 1)}"
    time, energy = rounded_time(bounds.time_us), rounded_energy(bounds.energy)
    return f"at most {steps}, {time} from issue to end, {energy} of a full charge"
