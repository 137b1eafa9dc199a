#!/usr/bin/env python3
"""Report prose that readers would have to translate.

usage: tools/words.py FILE|FOLDER ...

Reads comments and strings of Python, Cython and C sources, and the text of Markdown pages. Each
finding is `file:line: reason: text`. Exit status: 0 without findings, 1 with findings. A line that
is right as it is carries the comment `words: ok`.
"""

import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PYTHON, C, MARKDOWN = {".py", ".pyi", ".pyx", ".pxd"}, {".h", ".c"}, {".md"}
MARK = "words: ok"

REASONS = {
    "a device, thread or file is 'it', not a person": (
        r"(?<!users )(?<!user )(?<!people )(?<!one )"
        r"\b(who|whom|nobody|somebody|everybody)\b"  # words: ok
    ),
    "write 'not a' or 'none of'": (
        r"(?<!there )(?<!There )\b(is|are) (none|nothing|no) (?!longer\b|more\b|later\b|\d)"
    ),
    "use send, receive, report or read": (
        r"\b(is|are|was|were|been|be) (told|heard|asked for|looked at)\b|\bhears?\b|\blooked for\b"
    ),
    "use the textbook term (CONTRIBUTING.md, Words)": (
        r"\b(runs? dry|so long as|come what may|"  # words: ok
        r"comes? to (?!rest|a (?:stop|standstill))|"
        r"behind it all|beside it|for good|busy-?loops?)\b"  # words: ok
    ),
    "begin with an imperative verb or a noun phrase": (
        r'^\s*[rbf]?"""(What|Who|Where|When|Whether|Whose|How)\b'
    ),
    "put subject, verb and object in this order": (
        r"^\s*(#:?|//|/?\*+)?\s*(What|Where|Who) [a-z]+ (is|are|was|has)\b"
    ),
}
PATTERNS = {reason: re.compile(pattern) for reason, pattern in REASONS.items()}


class Line(NamedTuple):
    number: int
    text: str


def _python(text: str) -> Iterator[Line]:
    """Yield the lines of comments and strings."""
    strings = {tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT or token.type in strings:
            for offset, line in enumerate(token.string.splitlines()):
                yield Line(token.start[0] + offset, re.sub(r"\{[^{}]*\}", "{}", line))


def _c(text: str) -> Iterator[Line]:
    """Yield the lines of comments."""
    for comment in re.finditer(r"/\*.*?\*/|//[^\n]*", text, re.DOTALL):
        first = text.count("\n", 0, comment.start()) + 1
        for offset, line in enumerate(comment.group().splitlines()):
            yield Line(first + offset, line)


def _markdown(text: str) -> Iterator[Line]:
    """Yield the lines outside of code blocks; code in backquotes is left out."""
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith(("```", "~~~")):
            fenced = not fenced
        elif not fenced:
            yield Line(number, re.sub(r"`[^`]*`", "`code`", line))


def lines_of(path: Path) -> Iterator[Line]:
    """Yield the prose of a file, line by line."""
    text = path.read_text(encoding="utf-8")
    if path.suffix in PYTHON:
        return _python(text)
    return _c(text) if path.suffix in C else _markdown(text)


def findings(path: Path) -> Iterator[str]:
    """Yield one text for each line of a file that needs another wording."""
    source = path.read_text(encoding="utf-8").splitlines()
    for line in lines_of(path):
        if MARK in source[line.number - 1]:
            continue
        for reason, pattern in PATTERNS.items():
            if pattern.search(line.text):
                yield f"{path}:{line.number}: {reason}: {line.text.strip()[:100]}"


def files_of(arguments: list[str]) -> Iterator[Path]:
    """Yield the files among paths, and those in folders."""
    for path in map(Path, arguments):
        if path.is_dir():
            yield from (p for p in sorted(path.rglob("*")) if p.suffix in PYTHON | C | MARKDOWN)
        else:
            yield path


if __name__ == "__main__":
    found = [text for path in files_of(sys.argv[1:]) for text in findings(path)]
    print("\n".join(found) if found else "no findings")
    sys.exit(bool(found))
