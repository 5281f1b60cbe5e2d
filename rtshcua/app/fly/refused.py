"""A flight that does not begin."""

from rtshcua.diagnostics.exits import ExitCode


class Refused(Exception):
    """The flight does not begin: exit code, a stable slug, a text for a person, and perhaps help."""

    def __init__(self, code: ExitCode, slug: str, text: str, help: str | None = None) -> None:
        super().__init__(text)
        self.code = code
        self.slug = slug
        self.help = help
