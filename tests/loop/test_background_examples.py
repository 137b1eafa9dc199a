"""Examples of loops in the background run without arguments, and end without help."""

from __future__ import annotations

from tests.loop.test_examples import run


def test_notebook() -> None:
    out = run("notebook.py")
    assert "reached [rad]: [0.3" in out
    assert "device name: Catenary virtual servo" in out
    assert "error: None" in out


def test_asyncio_moves() -> None:
    out = run("asyncio_moves.py")
    lines = out.replace("-0.00", "0.00").splitlines()
    assert [line for line in lines if line.startswith("axis 0")] == [
        "axis 0: 0.30 rad",
        "axis 0: -0.30 rad",
        "axis 0: 0.00 rad",
    ]


def test_web_server() -> None:
    first, there, back = run("web_server.py").splitlines()
    assert "OPERATION_ENABLED" in first
    assert '"position": [0.' in there
    assert '"error": null' in back
