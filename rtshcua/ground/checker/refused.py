"""Why a GeoJSON text has no area for a zone."""

from rtshcua.diagnostics.codes import Code


class Refused(Exception):
    """The text has no such area: what is wrong, and what would help."""

    def __init__(self, code: Code, message: str, help: str | None = None) -> None:
        super().__init__(message)
        self.code, self.message, self.help = code, message, help
