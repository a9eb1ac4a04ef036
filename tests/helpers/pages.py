"""A page as its reader's parser sees it."""

import base64
from html.parser import HTMLParser
from pathlib import Path


class Page(HTMLParser):
    """Elements with their attributes, the text, and whether every element that opens is closed."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self, markup: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(markup)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & {*self.open}:
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def loaded(self) -> list[str | None]:
        """Addresses outside the page."""
        given = [
            a.get(name) for _, a in self.elements for name in ("src", "href", "srcset", "data", "action", "poster")
        ]
        return [address for address in given if not (address or "#").startswith(("#", "data:"))]


def read(path: Path) -> Page:
    return Page(path.read_text(encoding="utf-8"))


def pictures(page: Page) -> list[str]:
    return [base64.b64decode((image["src"] or "").split(",", 1)[1]).decode() for image in page.all("img")]
