"""Checks of a release that need no build."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

from tools.release_step import Failure, Release

UNRELEASED = "## Unreleased"
DATED = re.compile(r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", re.MULTILINE)
INIT = re.compile(r'^__version__ = "([^"]+)"$', re.MULTILINE)
PAGE = re.compile(r"This is version ([^\s,]+)")
STATUS = re.compile(r"^\*\*Status: (\S+)\. ", re.MULTILINE)
PACKAGE = re.compile(r"<version>([^<]+)</version>")


def check_tree(release: Release) -> str:
    """Check that all files are committed, and none is missing. Return the commit."""
    changed = release.run(["git", "status", "--porcelain"]).splitlines()
    commit = release.run(["git", "rev-parse", "--short", "HEAD"]).strip()
    if changed and not release.quick:
        raise Failure(f"{len(changed)} files are not committed, first: {changed[0]}")
    return f"note: {len(changed)} files are not committed" if changed else f"clean, at {commit}"


def check_version(release: Release) -> str:
    """Check that all files have the version of pyproject.toml. Return it."""
    found = dict(versions(release))
    base = re.sub(r"(a|b|rc|\.dev)\d+$", "", release.version)  # ROS packages have no candidates
    found = {name: release.version if value == base else value for name, value in found.items()}
    wrong = [f"{name}: {value}" for name, value in found.items() if value != release.version]
    if wrong:
        raise Failure(f"pyproject.toml has {release.version}; others have {', '.join(wrong)}")
    return f"{release.version} in pyproject.toml and {len(found)} other files"


def versions(release: Release) -> Iterator[tuple[str, str]]:
    """Yield the version in each file that has one."""
    for name, pattern in (
        ("src/catenary/__init__.py", INIT),
        ("docs/reference/versions.md", PAGE),
        ("README.md", STATUS),
        ("CHANGELOG.md", DATED),
        ("examples/ros2_control/package.xml", PACKAGE),
    ):
        match = pattern.search(text_of(release, name))
        yield name, match[1] if match else "none"


def check_changelog(release: Release) -> str:
    """Check that the first section is empty, and the second one is that of this release.

    With `quick`, as during development, unreleased lines are a note.
    """
    text = text_of(release, "CHANGELOG.md")
    before, found, after = text.partition(f"\n{UNRELEASED}\n")
    if not found or "\n## " in before:
        raise Failure(f"CHANGELOG.md: the first section must be {UNRELEASED!r}")
    section = DATED.search(after)
    if section is None or section[1] != release.version:
        raise Failure(f"CHANGELOG.md: no section '## {release.version} (YYYY-MM-DD)'")
    unreleased = len(after[: section.start()].split())
    if unreleased and not release.quick:
        raise Failure(f"CHANGELOG.md: {unreleased} words are still unreleased")
    lines = re.findall(r"^- ", after[section.end() :].partition("\n## ")[0], re.MULTILINE)
    note = f"; note: {unreleased} words are still unreleased" if unreleased else ""
    return f"{len(lines)} changes, {section[2]}{note}"


def check_results(release: Release) -> str:
    """Check that the figures of the documents are present as JSON, and can be read."""
    folder = release.root / "benchmarks" / "results"
    files = sorted(folder.glob("*/*/*.json"))
    if not files:
        raise Failure(f"{folder} has no results")
    for path in files:
        try:
            json.loads(path.read_text())
        except ValueError as error:
            raise Failure(f"{path.relative_to(release.root)}: {error}") from error
    missing = [str(path) for path in linked_results(release) if not path.exists()]
    if missing:
        raise Failure(f"results that a document links to are missing: {missing[0]}")
    machines = sorted({path.relative_to(folder).parts[0] for path in files})
    return f"{len(files)} files of {', '.join(machines)}"


def linked_results(release: Release) -> Iterator[Path]:
    """Yield the results that pages of the documentation link to."""
    for page in (release.root / "docs").glob("*/*.md"):
        for link in re.findall(r"\]\((\.\./\.\./benchmarks/[^)#]+)\)", page.read_text()):
            yield page.parent / link


def check_examples(release: Release) -> str:
    """Check that all examples compile. The step `tests` runs them."""
    files = sorted((release.root / "examples").rglob("*.py"))
    for path in files:
        try:
            compile(path.read_text(), str(path), "exec")
        except SyntaxError as error:
            raise Failure(
                f"{path.relative_to(release.root)}:{error.lineno}: {error.msg}"
            ) from error
    if not files:
        raise Failure("there are no examples")
    return f"{len(files)} programs compile"


def text_of(release: Release, name: str) -> str:
    try:
        return (release.root / name).read_text()
    except OSError as error:
        raise Failure(f"{name}: {error.strerror}") from error
