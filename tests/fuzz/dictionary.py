"""A dictionary for libFuzzer: the keywords of the grammar, and the names of the shipped sources."""

from fuzz.mutation.words import _MARKS, _UNITS, _pool


def dictionary() -> str:
    """One entry a line."""
    words = {*_MARKS, *_UNITS, *_pool()[2], "within the last", "for the last", '"parts/site.geojson"', '"lib:'} - {""}
    words |= {"Polygon", "MultiPolygon", "coordinates", "geometry", "Feature", "properties", '"type"'}
    return "".join(f'"{_escaped(word)}"\n' for word in sorted(words))


def _escaped(word: str) -> str:
    """Escape everything except ASCII letters and digits as bytes."""
    return "".join(chr(each) if chr(each).isalnum() and each < 128 else f"\\x{each:02X}" for each in word.encode())
