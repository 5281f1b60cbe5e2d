"""Mutations that insert comments and blanks between any two tokens of a source."""

import re
from random import Random

_WORD = re.compile(
    r"""//[^\n]* | /\*.*?\*/ | "(?:[^"\\\n]|\\.)*" | [0-9]{1,2}:[0-9]{2} | \.\. | [<>=!]= | %
      | [0-9]+(?:_[0-9]+)*(?:\.[0-9]+)? | [A-Za-z_][\w.]*(?:/[A-Za-z]\w*)? | \s+ | .""",
    re.VERBOSE | re.DOTALL,
)
_LINES = (
    "// x", "//", "// rtshcua: ignore E1304 because the letter says so", "//\ttab ", "// \"quote", "// */ /*",
    "// rtshcua: ignore-file naming because so", "//é…",
)  # fmt: skip
_BLOCKS = ("/* y */", "/**/", "/* two\n   lines */", "/* // */", "/*\n*/", "/***/", "/* \t\r\n\n x*/")
_BLANKS = (" ", "\n", "\n\n", "\n\n\n\n", "\t", "\r\n", "  \n  ", "\f", "")


def sprinkled(text: str, of: Random) -> str:
    """Insert comments and blanks at random: few in many places, or many in a few."""
    chance = of.choice([0.005, 0.02, 0.1, 0.5])
    only_blanks = of.random() < 0.2
    made = []
    for word in _WORD.findall(text):
        if word.isspace():
            if of.random() < chance:
                word = of.choice(_BLANKS[:-1])
        elif of.random() < chance:
            made.append(of.choice(_BLANKS) if only_blanks else _some(of))
        made.append(word)
    return "".join(made)


def _some(of: Random) -> str:
    made = of.choice(_BLANKS)
    for _ in range(of.choice([1, 1, 1, 2, 3])):
        made += of.choice(_LINES) + "\n" if of.random() < 0.5 else of.choice(_BLOCKS)
        made += of.choice(_BLANKS)
    return made


def joined(text: str, of: Random) -> str:
    """Remove or insert line ends at blanks."""
    chance = of.choice([0.1, 0.5, 1.0])

    def other(found: re.Match[str]) -> str:
        if found[0].startswith("//") or of.random() > chance:
            return found[0]
        return of.choice([" ", "\n"]) if found[0].isspace() else found[0]

    return re.sub(r"//[^\n]*\n|/\*.*?\*/|\"(?:[^\"\\\n]|\\.)*\"|\s+", other, text, flags=re.DOTALL)
