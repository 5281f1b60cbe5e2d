"""The elements of an HTML page as a strict parser sees them."""

from html.parser import HTMLParser

VOID = {"meta", "link", "br", "hr", "img", "input"}
#: elements that end an open paragraph, so that a browser changes the structure
BLOCKS = {"p", "ul", "ol", "dl", "div", "table", "section", "figure", "pre", "h1", "h2", "h3", "h4"}


class Outline(HTMLParser):
    """The elements of a page, and errors of their nesting."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if "p" in self.open and tag in BLOCKS:
            self.wrong.append(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)

    def of(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]
