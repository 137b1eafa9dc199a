"""Streaming XML parser of ESI files, based on expat.

Only the wanted elements become trees, one at a time, so that a large file is never in memory as a
tree. Each tree has its place in the file, from which `read_fragment` parses it again. Tags and
attributes are local names: namespace prefixes are ignored. Document types and entities are refused.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple, Never
from xml.parsers import expat

from catenary.errors import EsiError
from catenary.esi.document import LIMITS, Document, Limits, make_fragment
from catenary.esi.encoding import Encoding

PIECE = 1 << 18  # bytes that expat receives at once
TAG = re.compile(r"""<(?:[^"'>]|"[^"]*"|'[^']*')*>""")
NEXT_STEP = "obtain the file again from the vendor; it may be incomplete"


class Element(NamedTuple):
    """Element with its direct text, its children and its line in the file."""

    tag: str
    attributes: dict[str, str]
    text: str
    children: tuple[Element, ...]
    line: int

    def find(self, tag: str) -> Element | None:
        """Return the first child with a tag; None if there is none."""
        for child in self.children:
            if child.tag == tag:
                return child
        return None

    def all(self, *tags: str) -> tuple[Element, ...]:
        """Return all children with one of the tags, in the order of the file."""
        return tuple(child for child in self.children if child.tag in tags)

    def at(self, path: str) -> Element | None:
        """Return the first element at a path, such as "Info/StateMachine/Timeout"."""
        found: Element | None = self
        for tag in path.split("/"):
            found = found.find(tag) if found is not None else None
        return found


class Found(NamedTuple):
    """One wanted element of a document, with its path and its place in the file.

    `offset` and `length` count the bytes of the file as it is on disk, in every encoding.
    """

    path: str
    element: Element
    offset: int
    length: int


def read_fragment(
    data: bytes, encoding: Encoding, *, file: str, line: int, limits: Limits = LIMITS
) -> Element:
    """Return the tree of one element, from its bytes.

    Args:
        data: The bytes at the place that `Found` gives.
        encoding: The encoding of the file (`Document.encoding`).
        file: The name of the file for messages.
        line: The line of the element in the file.
        limits: Limits of the element.

    Raises:
        EsiError: The bytes are not one element, for example because the file changed.
    """
    document = make_fragment(data, encoding, file=file, line=line)
    (found,) = find_elements(document, frozenset({""}), limits=limits)
    return found.element


def find_elements(
    document: Document,
    wanted: frozenset[str],
    *,
    kept: frozenset[str] | None = None,
    limits: Limits = LIMITS,
) -> Iterator[Found]:
    """Yield the wanted elements of a document, in its order.

    Args:
        document: The document.
        wanted: Paths below the root, such as "Descriptions/Devices/Device". The empty path is the
            root, with all its elements.
        kept: Tags of the children that the trees contain; None keeps all of them. Few children make
            a fast pass over a large file.
        limits: Limits of the file.

    Raises:
        EsiError: The document is not well-formed XML, has a document type, or exceeds a limit.
    """
    parser = _Parser(document, wanted, kept, limits)
    data = memoryview(document.data)
    for start in range(document.mark, len(data), PIECE):
        parser.feed(data[start : start + PIECE], start, False)
        while parser.found:
            yield parser.found.popleft()
    parser.feed(data[:0], len(data), True)
    yield from parser.found


def root_tag(document: Document) -> str:
    """Return the tag of the root; empty if the first bytes do not contain one.

    Raises:
        EsiError: The document is not well-formed XML before its root.
    """
    parser = _Parser(document, frozenset(), None, Limits())
    data = memoryview(document.data)
    for start in range(document.mark, min(len(data), 4 * PIECE), PIECE):
        parser.feed(data[start : start + PIECE], start, False)
        if parser.root:
            break
    return parser.root


class _Open(NamedTuple):
    """Element whose end was not reached."""

    tag: str
    attributes: dict[str, str]
    line: int
    first_text: int  # number of its first text in `_Parser._texts`
    children: list[Element]


class _Parser:
    """State of one pass: the open elements, and the trees that are complete."""

    def __init__(
        self,
        document: Document,
        wanted: frozenset[str],
        kept: frozenset[str] | None,
        limits: Limits,
    ) -> None:
        self.document = document
        self.wanted = wanted
        self.kept = kept
        self.limits = limits
        self.found: deque[Found] = deque()
        self.root = ""
        self._ways = {"/".join(path.split("/")[:n]) for path in wanted for n in range(9)}
        self._path: list[str] = []  # open elements outside of wanted trees, without the root
        self._open: list[_Open] = []  # open elements of the current tree
        self._ignored = 0  # number of open elements from the first ignored one on
        self._place = (0, 0)  # offset of the current tree; its end if it is empty, otherwise 0
        # Texts of the open elements. An element removes its own at its end, so that those of the
        # elements around it remain. The parser calls `append` itself, without a Python function.
        self._texts: list[str] = []
        self._elements = 0  # started
        self._tree_end = limits.elements  # number of the last element that the tree may contain
        self._base = document.mark
        self._line_offset = document.line - 1
        self._decode = document.encoding.text
        self._expat = parser = expat.ParserCreate(document.encoding.transport)
        parser.buffer_text = True
        parser.buffer_size = 65_536
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = self._document_type

    def feed(self, piece: memoryview, start: int, final: bool) -> None:
        """Parse the next bytes."""
        try:
            self._expat.Parse(piece, final)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            line = self.document.line + error.lineno - 1
            raise EsiError(
                f"not well-formed XML: {reason}",
                file=self.document.file,
                line=line,
                hint=NEXT_STEP,
            ) from None
        position = self._expat.CurrentByteIndex + self._base
        if position >= 0 and start + len(piece) - position > self.limits.token_size + PIECE:
            self._refuse(f"a tag or comment is longer than {self.limits.token_size} bytes")

    def _refuse(self, message: str, hint: str = "") -> Never:
        raise EsiError(message, file=self.document.file, line=self._line, hint=hint)

    @property
    def _line(self) -> int:
        return self._expat.CurrentLineNumber + self._line_offset

    def _document_type(self, *_: object) -> None:
        self._refuse("a document type is not allowed", "remove the DOCTYPE from the file")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._elements += 1
        if self._elements > self._tree_end:
            self._refuse_elements()
        if self._ignored:
            self._ignored += 1
            if self._ignored > self.limits.depth:
                self._refuse(f"elements are nested deeper than {self.limits.depth}")
            return
        tag = name.rpartition(":")[2] or name if ":" in name else name
        if self._open:
            if self.kept is not None and len(self._open) == 1 and tag not in self.kept:
                self._ignore()
            else:
                self._push(tag, attributes)
            return
        self._descend(tag, attributes)

    def _descend(self, tag: str, attributes: dict[str, str]) -> None:
        """Follow the path to the wanted elements."""
        path = "/".join((*self._path, tag)) if self.root else ""
        self.root = self.root or tag
        if path in self.wanted:
            start = self._expat.CurrentByteIndex + self._base
            self._place = start, self._end_of_empty(start)
            last = self._elements + self.limits.tree_elements - 1
            self._tree_end = min(last, self.limits.elements)
            self._push(tag, attributes)
            self._expat.CharacterDataHandler = self._texts.append
        elif path in self._ways:
            if path:
                self._path.append(tag)
        else:
            self._ignore()

    def _ignore(self) -> None:
        self._ignored = 1
        self._expat.CharacterDataHandler = None

    def _push(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self._path) + len(self._open) >= self.limits.depth:
            self._refuse(f"elements are nested deeper than {self.limits.depth}")
        if attributes:
            attributes = self._decoded(attributes)
        line = self._expat.CurrentLineNumber + self._line_offset
        self._open.append(_Open(tag, attributes, line, len(self._texts), []))

    def _refuse_elements(self) -> Never:
        if self._elements > self.limits.elements:
            self._refuse(f"more than {self.limits.elements} elements")
        tree = self._open[0].tag
        self._refuse(f"more than {self.limits.tree_elements} elements in one {tree}")

    def _decoded(self, attributes: dict[str, str]) -> dict[str, str]:
        """Return the attributes with local names and decoded values."""
        if len(attributes) > self.limits.attributes:
            self._refuse(f"more than {self.limits.attributes} attributes")
        if any(len(value) > self.limits.attribute_length for value in attributes.values()):
            self._refuse(f"an attribute is longer than {self.limits.attribute_length} characters")
        return {
            name.rpartition(":")[2]: self._decode(value)
            for name, value in attributes.items()
            if not name.startswith("xmlns")
        }

    def _end(self, _name: str) -> None:
        if self._ignored:
            self._ignored -= 1
            if not self._ignored and self._open:
                self._expat.CharacterDataHandler = self._texts.append
            return
        if not self._open:
            del self._path[-1:]
            return
        tag, attributes, line, first_text, children = self._open.pop()
        element = Element(tag, attributes, self._text(first_text), tuple(children), line)
        if not self._open:
            self._finish(element)
            return
        siblings = self._open[-1].children
        if len(siblings) >= self.limits.children:
            self._refuse(f"more than {self.limits.children} children")
        siblings.append(element)

    def _text(self, first: int) -> str:
        """Return the text of the element that ends, and remove it from the texts."""
        text = "".join(self._texts[first:])
        del self._texts[first:]
        if len(text) > self.limits.text_length:
            self._refuse(f"a text is longer than {self.limits.text_length} characters")
        return text if text.isascii() else self._decode(text)

    def _finish(self, element: Element) -> None:
        self._expat.CharacterDataHandler = None
        self._tree_end = self.limits.elements
        start, end = self._place
        if not end:
            closing = self._expat.CurrentByteIndex + self._base
            end = self._end_of_tag(closing)
        path = "/".join((*self._path, element.tag)) if "" not in self.wanted else ""
        self.found.append(Found(path, element, start, end - start))

    def _end_of_empty(self, start: int) -> int:
        """Return the end of an element without content (`<Device/>`); 0 for other elements."""
        end = self._end_of_tag(start)
        slash = "/>".encode(self.document.encoding.name)
        return end if self.document.data[end - len(slash) : end] == slash else 0

    def _end_of_tag(self, start: int) -> int:
        """Return the offset after the tag that begins at an offset."""
        unit = self.document.encoding.unit
        for size in (256, 1 << 16, self.limits.token_size):
            piece = self.document.data[start : start + size * unit]
            codec = "latin-1" if unit == 1 else self.document.encoding.name
            text = piece.decode(codec, "ignore")
            tag = TAG.match(text)
            if tag is not None:
                return start + len(tag[0].encode(codec))
        return start
