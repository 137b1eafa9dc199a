"""`python -m tools.release`: each check fails for its reason, and the archive is reproducible."""

from __future__ import annotations

import subprocess
import tarfile
from pathlib import Path

import pytest

from tools import release_builds, release_checks
from tools.release import CHECKS, main, run_step
from tools.release_step import ROOT, Failure, Release

FILES = {
    "pyproject.toml": '[project]\nversion = "1.2.0rc1"\n',
    "src/catenary/__init__.py": '__version__ = "1.2.0rc1"\n',
    "docs/reference/versions.md": (
        "This is version 1.2.0rc1, [x](../../benchmarks/results/a/d/b.json)"
    ),
    "README.md": "**Status: 1.2.0rc1. It is",
    "CHANGELOG.md": "# Changelog\n\n## Unreleased\n\n## 1.2.0rc1 (2026-01-02)\n\n- One.\n- Two.\n",
    "examples/ros2_control/package.xml": "<version>1.2.0</version>",
    "examples/one.py": "print(1)\n",
    "benchmarks/results/a/d/b.json": "{}",
}


@pytest.fixture
def release(tmp_path: Path) -> Release:
    """Make a small clone that is ready for a release."""
    root = tmp_path / "clone"
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    git = ["git", "-C", str(root), "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "One"]):
        subprocess.run([*git, *command], check=True)
    return Release(root, tmp_path / "out")


def test_a_complete_clone_passes_all_checks(release: Release) -> None:
    texts = [step(release) for step in CHECKS.values()]
    assert texts[0].startswith("clean, at ")
    assert texts[1:] == [
        "1.2.0rc1 in pyproject.toml and 5 other files",
        "2 changes, 2026-01-02",
        "1 files of a",
        "1 programs compile",
    ]


@pytest.mark.parametrize(
    ("name", "text", "step", "reason"),
    [
        ("new.txt", "", "tree", r"1 files are not committed, first: \?\? new.txt"),
        ("src/catenary/__init__.py", '__version__ = "1.1.0"\n', "version", "__init__.py: 1.1.0"),
        ("docs/reference/versions.md", "", "version", "versions.md: none"),
        ("examples/ros2_control/package.xml", "<version>1.1.0</version>", "version", "1.1.0"),
        ("CHANGELOG.md", "## 1.2.0rc1 (2026-01-02)\n", "changelog", "first section must be"),
        ("CHANGELOG.md", "\n## Unreleased\n\n## 1.1.0 (2026-01-02)\n", "changelog", "no section"),
        (
            "CHANGELOG.md",
            "\n## Unreleased\n\n- New.\n\n## 1.2.0rc1 (2026-01-02)\n",
            *("changelog", "2 words are still unreleased"),
        ),
        ("benchmarks/results/a/d/b.json", "{", "results", "b.json: "),
        ("docs/how_to/a.md", "[x](../../benchmarks/results/a/d/c.json)", "results", "c.json"),
        ("examples/one.py", "print(\n", "examples", "examples/one.py:1: "),
    ],
)
def test_a_check_fails_for_its_reason(
    name: str, text: str, step: str, reason: str, release: Release
) -> None:
    path = release.root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    with pytest.raises(Failure, match=reason):
        CHECKS[step](release)


def test_a_changed_tree_is_a_note_in_quick_mode(release: Release) -> None:
    (release.root / "new.txt").touch()
    quick = Release(release.root, release.out, quick=True)
    assert release_checks.check_tree(quick) == "note: 1 files are not committed"


def test_unreleased_changes_are_a_note_in_quick_mode(release: Release) -> None:
    path = release.root / "CHANGELOG.md"
    path.write_text(path.read_text().replace("## Unreleased\n", "## Unreleased\n\n- New.\n"))
    quick = Release(release.root, release.out, quick=True)
    assert release_checks.check_changelog(quick) == (
        "2 changes, 2026-01-02; note: 2 words are still unreleased"
    )


def test_a_failure_is_printed_with_its_reason(
    release: Release, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(release: Release) -> str:
        return release.run(["sh", "-c", "echo broken; exit 3"])

    assert not run_step("x", fail, release)
    out = capsys.readouterr().out
    assert out.startswith("FAIL  x ")
    assert "exit status 3\n      broken" in out


def test_the_archive_of_the_documentation_is_reproducible(tmp_path: Path) -> None:
    folder = tmp_path / "docs"
    (folder / "a").mkdir(parents=True)
    (folder / "index.html").write_text("start")
    (folder / "a" / "page.html").write_text("page")
    paths = [tmp_path / "1.tar.gz", tmp_path / "2.tar.gz"]
    for path in paths:
        (folder / "a" / "page.html").touch()
        assert release_builds.pack(folder, path, "docs-1") == 2
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with tarfile.open(paths[0]) as archive:
        assert archive.getnames() == ["docs-1/a/page.html", "docs-1/index.html"]
        content = archive.extractfile("docs-1/index.html")
        assert content is not None
        assert content.read() == b"start"


def test_a_missing_site_is_not_packed(tmp_path: Path) -> None:
    with pytest.raises(Failure, match=r"no index\.html"):
        release_builds.pack(tmp_path, tmp_path / "x.tar.gz", "x")


def test_wheels_are_built_by_the_script(release: Release) -> None:
    tool = release.root / "tools" / "build_wheels"
    tool.parent.mkdir()
    tool.write_text('#!/bin/sh\nmkdir -p "$2"\n: >"$2/catenary-1.2.0rc1-cp311-cp311-x.whl"\n')
    tool.chmod(0o755)
    assert release_builds.build_wheels(release) == "catenary-1.2.0rc1-cp311-cp311-x.whl"
    with pytest.raises(Failure, match="no Python at hand has a wheel"):  # for this processor
        release_builds.test_pythons(release)
    assert release_builds.write_sums(release) == "SHA256SUMS: 1 files"
    [line] = (release.out / "SHA256SUMS").read_text().splitlines()
    assert line.split() == [
        "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
        "catenary-1.2.0rc1-cp311-cp311-x.whl",
    ]


def test_the_files_of_an_earlier_run_are_removed(release: Release) -> None:
    folder = release.out / "environments"
    folder.mkdir(parents=True)
    for name in ("catenary-1.1.0.tar.gz", "SHA256SUMS", "notes.txt"):
        (release.out / name).touch()
    release_builds.remove_files(release)
    assert sorted(release.out.iterdir()) == [folder, release.out / "notes.txt"]


def test_this_clone_passes_the_quick_checks(capsys: pytest.CaptureFixture[str]) -> None:
    if not (ROOT / "benchmarks" / "results").is_dir() or not (ROOT / ".git").exists():
        pytest.skip("a source distribution has no results and no repository")
    assert main(["--quick"]) == 0, capsys.readouterr().out
