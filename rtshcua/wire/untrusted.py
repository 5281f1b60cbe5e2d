"""The base class of all errors about untrusted data."""


class Untrusted(ValueError):
    """Data that is not trusted: `slug` is stable and for programs, the text is for a person."""

    def __init__(self, slug: str, text: str) -> None:
        super().__init__(text)
        self.slug = slug
