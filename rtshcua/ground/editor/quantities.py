"""A number in its canonical unit, and in every other one of its dimension."""

from rtshcua.ground.language.exact import CANONICAL
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.quantity import UNITS, Dimension, Unit

_DIGITS = 6  # behind the point, where a unit gives no whole number


def told_number(node: Quantity) -> str:
    """`20 m = 20000 mm`, and further units."""
    dimension = Dimension.LENGTH if node.dimension is Dimension.ALTITUDE else node.dimension
    datum = "" if node.datum is None else f" above {node.datum.value}"
    if dimension is Dimension.COUNT:
        return f"a plain number: {node.value}"
    others = [f"{converted(node.value, unit)} {name}" for name, unit in UNITS.items() if unit.dimension is dimension]
    kind = "altitude" if node.datum is not None else dimension.value
    return f"{kind}{datum}, kept as {node.value} {CANONICAL[dimension]}\n\n" + " = ".join(others)


def converted(value: int, unit: Unit) -> str:
    """A canonical number in a unit, rounded where it has no end."""
    scaled, rest = divmod(abs(value) * unit.denominator * 10**_DIGITS, unit.numerator)
    about = "≈ " if rest else ""
    whole, fraction = divmod(scaled, 10**_DIGITS)
    digits = str(fraction).zfill(_DIGITS).rstrip("0")
    return f"{about}{'-' if value < 0 else ''}{whole}{'.' + digits if digits else ''}"
