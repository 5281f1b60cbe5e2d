"""Vectors of the integer plane."""

from math import isqrt

from rtshcua.ground.geometry.shapes import Point


def scaled(vector: Point, length: int) -> Point:
    """The vector of that length in the same direction, its parts rounded towards zero."""
    x, y = vector
    root = isqrt((x * x + y * y) << 40) + 1

    def part(value: int) -> int:
        magnitude = (abs(value) * length << 20) // root
        return magnitude if value >= 0 else -magnitude

    return part(x), part(y)


def dot(a: Point, b: Point) -> int:
    """The inner product."""
    return a[0] * b[0] + a[1] * b[1]


def square(a: Point, b: Point) -> int:
    """The squared distance of two points."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2
