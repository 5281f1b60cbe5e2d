"""The base of every refusal to trust something that was handed over."""


class Untrusted(ValueError):
    """Something that is not to be trusted: `slug` is stable and for programs, the text is for a person."""

    def __init__(self, slug: str, text: str) -> None:
        super().__init__(text)
        self.slug = slug
