"""Write XML documents as UTF-8. Texts must have passed `shown`, which leaves no character that XML 1.0 forbids."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement


def add(parent: Element, tag: str, text: str | None = None, **attributes: str) -> Element:
    """Add an element, with its text."""
    element = SubElement(parent, tag, attributes)
    element.text = text
    return element


def document(root: Element) -> bytes:
    """The octets of a document, indented."""
    ElementTree.indent(root, " ")
    text: str = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
