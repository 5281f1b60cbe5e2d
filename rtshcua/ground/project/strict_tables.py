"""Reads the tables of a configuration strictly: known keys, right types, and a reason for every ignore."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from rtshcua.diagnostics.codes import REGISTRY, Code, Severity, can_be_ignored, code_named
from rtshcua.diagnostics.suggest import listed, nearest

#: the least number of letters and digits in a reason
SHORTEST = 3


def is_reason(reason: str) -> bool:
    """Whether a text can be a reason: it needs letters, because punctuation and invisible characters say nothing."""
    return sum(map(str.isalnum, reason)) >= SHORTEST and any(map(str.isalpha, reason))


T = TypeVar("T", bound=str)


class SettingError(Exception):
    """A key of a configuration is wrong: which key, what was found, and what is accepted."""

    def __init__(self, key: str, message: str, help: str = "") -> None:
        super().__init__(message)
        self.key, self.message, self.help = key, message, help


class SettingsTable:
    """A table of a configuration. `close` refuses the keys that were not read. All methods raise `SettingError`."""

    def __init__(self, found: Mapping[str, Any], name: str) -> None:
        self._found = found
        self._name = name
        self._known: dict[str, None] = {}

    @staticmethod
    def of(found: Any, name: str) -> "SettingsTable":
        """The value `found` under a name, which must be a table."""
        if not isinstance(found, dict):
            raise SettingError(name.rpartition(".")[2], f"`{name}` is {_kind(found)}; expected a table")
        return SettingsTable(found, name)

    @property
    def name(self) -> str:
        """The dotted name of the table."""
        return self._name

    def names(self) -> tuple[str, ...]:
        """The keys of the table, all of which count as read."""
        self._known |= dict.fromkeys(self._found)
        return tuple(self._found)

    def table(self, key: str) -> "SettingsTable":
        """The table at a key; an empty one if there is none."""
        self._known[key] = None
        return SettingsTable.of(self._found.get(key, {}), f"{self._name}.{key}" if self._name else key)

    def any_of(self, key: str, types: tuple[type, ...], accepted: str) -> Any:
        """The value at a key, which must be of one of these types; None if there is none."""
        self._known[key] = None
        found = self._found.get(key)
        if found is not None and type(found) not in types:
            raise SettingError(key, f"`{key}`{self._where()} is {_kind(found)}", f"accepted: {accepted}")
        return found

    def flag(self, key: str, *, default: bool) -> bool:
        """The `true` or `false` at a key."""
        found = self.any_of(key, (bool,), "`true` or `false`")
        return default if found is None else bool(found)

    def number(self, key: str, least: int, most: int) -> int | None:
        """The whole number at a key, which must be in a range; None if there is none."""
        found = self.any_of(key, (int,), f"a whole number from {least} to {most}")
        if found is not None and not least <= found <= most:
            raise SettingError(
                key, f"`{key}`{self._where()} is {found}", f"accepted: a whole number from {least} to {most}"
            )
        return None if found is None else int(found)

    def texts(self, key: str) -> tuple[str, ...]:
        """The list of strings at a key, none of which may be empty."""
        found = self.any_of(key, (list,), f'a list of strings, as in `{key} = ["drafts"]`') or []
        for each in found:
            if not isinstance(each, str) or not each.strip():
                what = "an empty string" if isinstance(each, str) else _kind(each)
                raise SettingError(key, f"`{key}`{self._where()} has {what} in its list", "accepted: a list of strings")
        return tuple(found)

    def one_of(self, key: str, words: Sequence[T], default: T) -> T:
        """The string at a key, which must be one of several words."""
        found = self.any_of(key, (str,), listed(words))
        if found is None:
            return default
        for word in words:
            if word == found:
                return word
        near = nearest(found, words)
        help = f"accepted: {listed(words)}" if near is None else f"did you mean `{near}`?"
        raise SettingError(key, f"`{found}` is not a value of `{key}`{self._where()}", help)

    def code(self, name: str) -> Code:
        """The code that a key of this table names by id or slug. A code of an error is refused."""
        code = code_named(name)
        if code is None:
            raise SettingError(name, f"unknown code `{name}`", _near_code(name))
        if code.severity is Severity.ERROR:
            raise SettingError(name, f"`{name}` is an error, and errors cannot be ignored")
        if not can_be_ignored(code):
            raise SettingError(name, f"`{name}` is about ignores, and cannot be ignored")
        return code

    def reason(self, name: str) -> str:
        """The reason of an ignore, which is the value of its key."""
        help = f'give a reason, as in `{name} = "the authority\'s letter says 30 m"`'
        found = self._found[name]
        if not isinstance(found, str):
            raise SettingError(name, f"`{name}`{self._where()} is {_kind(found)}; expected a reason", help)
        if not is_reason(found):
            raise SettingError(name, f"`{name}`{self._where()} is ignored without a reason", help)
        return " ".join(found.split())

    def close(self) -> None:
        """Refuse the first key that was not read."""
        for key in self._found:
            if key not in self._known:
                near = nearest(key, self._known)
                help = f"known: {listed(self._known)}" if near is None else f"did you mean `{near}`?"
                raise SettingError(key, f"unknown key `{key}`{self._where()}", help)

    def _where(self) -> str:
        return f" in `[{self._name}]`" if self._name else ""


def _near_code(name: str) -> str:
    near = nearest(name, [*REGISTRY, *(code.slug for code in REGISTRY.values())])
    return "write a code as `E1304` or `repeated-number`" if near is None else f"did you mean `{near}`?"


def _kind(found: object) -> str:
    """The type of a TOML value."""
    if isinstance(found, bool):
        return f"`{str(found).lower()}`"
    kinds = {int: "a whole number", float: "a decimal number", str: "a string", list: "a list", dict: "a table"}
    return kinds.get(type(found), "a date or a time")
