"""Reads the tables of a configuration strictly: known keys, right types, and a reason for every ignore."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from rtshcua.diagnostics.codes import REGISTRY, Code, Severity, can_be_ignored, code_named
from rtshcua.diagnostics.suggest import listed, nearest

#: a reason has at least so many letters and digits
SHORTEST = 3


def is_reason(reason: str) -> bool:
    """Whether a text can be a reason: it has letters. Points and marks alone say nothing, seen or unseen."""
    return sum(map(str.isalnum, reason)) >= SHORTEST and any(map(str.isalpha, reason))


T = TypeVar("T", bound=str)


class SettingError(Exception):
    """A key is not as it must be: which, what was found, and what would be accepted."""

    def __init__(self, key: str, message: str, help: str = "") -> None:
        super().__init__(message)
        self.key, self.message, self.help = key, message, help


class SettingsTable:
    """A table of a configuration: `close` refuses what nobody asked for. All methods raise NotSo."""

    def __init__(self, found: Mapping[str, Any], name: str) -> None:
        self._found = found
        self._name = name
        self._asked: dict[str, None] = {}

    @staticmethod
    def of(found: Any, name: str) -> "SettingsTable":
        """What was found under a name, which must be a table."""
        if not isinstance(found, dict):
            raise SettingError(name.rpartition(".")[2], f"`{name}` is {_kind(found)}, and must be a table")
        return SettingsTable(found, name)

    @property
    def name(self) -> str:
        """What it is called, from the top."""
        return self._name

    def names(self) -> tuple[str, ...]:
        """The keys that there are, all of which count as asked for."""
        self._asked |= dict.fromkeys(self._found)
        return tuple(self._found)

    def table(self, key: str) -> "SettingsTable":
        """A table in this one; an empty one where there is none."""
        self._asked[key] = None
        return SettingsTable.of(self._found.get(key, {}), f"{self._name}.{key}" if self._name else key)

    def any_of(self, key: str, types: tuple[type, ...], words: str) -> Any:
        """A value of one of these types; None where there is none."""
        self._asked[key] = None
        found = self._found.get(key)
        if found is not None and type(found) not in types:
            raise SettingError(key, f"`{key}`{self._where()} is {_kind(found)}", f"accepted: {words}")
        return found

    def flag(self, key: str, *, default: bool) -> bool:
        """`true` or `false`."""
        found = self.any_of(key, (bool,), "`true` or `false`")
        return default if found is None else bool(found)

    def number(self, key: str, least: int, most: int) -> int | None:
        """A whole number of a range; None where there is none."""
        found = self.any_of(key, (int,), f"a whole number from {least} to {most}")
        if found is not None and not least <= found <= most:
            raise SettingError(
                key, f"`{key}`{self._where()} is {found}", f"accepted: a whole number from {least} to {most}"
            )
        return None if found is None else int(found)

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts, none of them empty."""
        found = self.any_of(key, (list,), f'a list of texts, as in `{key} = ["drafts"]`') or []
        for each in found:
            if not isinstance(each, str) or not each.strip():
                what = "an empty text" if isinstance(each, str) else _kind(each)
                raise SettingError(key, f"`{key}`{self._where()} has {what} in its list", "accepted: a list of texts")
        return tuple(found)

    def one_of(self, key: str, words: Sequence[T], default: T) -> T:
        """One of several words."""
        found = self.any_of(key, (str,), listed(words))
        if found is None:
            return default
        for word in words:
            if word == found:
                return word
        near = nearest(found, words)
        help = f"accepted: {listed(words)}" if near is None else f"did you mean `{near}`?"
        raise SettingError(key, f"`{found}` is nothing that `{key}`{self._where()} can be", help)

    def code(self, name: str) -> Code:
        """The kind of finding that a key of this table names, by its id or its slug; errors cannot be ignored."""
        code = code_named(name)
        if code is None:
            raise SettingError(name, f"there is no code `{name}`", _near_code(name))
        if code.severity is Severity.ERROR:
            raise SettingError(name, f"`{name}` is an error, and errors cannot be ignored")
        if not can_be_ignored(code):
            raise SettingError(name, f"`{name}` is about ignores themselves, and cannot be ignored")
        return code

    def reason(self, name: str) -> str:
        """The reason that stands after the `=` of an ignore."""
        help = f'say why, as in `{name} = "the authority\'s letter says 30 m"`'
        found = self._found[name]
        if not isinstance(found, str):
            raise SettingError(name, f"`{name}`{self._where()} is {_kind(found)}, and must be a reason", help)
        if not is_reason(found):
            raise SettingError(name, f"`{name}`{self._where()} is ignored without a reason", help)
        return " ".join(found.split())

    def close(self) -> None:
        """Refuse the first key that nothing asked for."""
        for key in self._found:
            if key not in self._asked:
                near = nearest(key, self._asked)
                help = f"known: {listed(self._asked)}" if near is None else f"did you mean `{near}`?"
                raise SettingError(key, f"there is no key `{key}`{self._where()}", help)

    def _where(self) -> str:
        return f" in `[{self._name}]`" if self._name else ""


def _near_code(name: str) -> str:
    near = nearest(name, [*REGISTRY, *(code.slug for code in REGISTRY.values())])
    return "codes are written as `E1304` or `repeated-number`" if near is None else f"did you mean `{near}`?"


def _kind(found: object) -> str:
    """What TOML calls a value."""
    words = {bool: "`true` or `false`", int: "a whole number", float: "a number with a point", str: "a text",
             list: "a list", dict: "a table"}  # fmt: skip
    if isinstance(found, bool):
        return f"`{str(found).lower()}`"
    return words.get(type(found), "a date or a time")
