"""The structures of catenary_share.h have the sizes and offsets that Python uses."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from catenary.share import Reason, layout
from catenary.share.command_table import (
    COMMANDS,
    HEAD,
    MAGIC,
    MOTION,
    PLACE,
    PLACES,
    field_offset,
    geometry,
    row_dtype,
)
from tests.share.c.compile import C11, HERE, build


def test_structures_are_those_of_python(tmp_path: Path) -> None:
    program = build(tmp_path / "layout", C11, HERE / "layout.c")
    found = json.loads(subprocess.run([program], capture_output=True, check=True).stdout)
    assert PLACE.names is not None
    for name in PLACE.names:
        assert found[f"cat_desk_place.{name}"] == field_offset(PLACE, name)
    for name in ("stop", "stopper"):
        assert found[f"cat_motion.{name}"] == field_offset(MOTION, name)
    for axes in (0, 1, 33):
        assert found[f"parts {axes}"] == list(geometry(axes))
        assert found[f"row {axes}"] == row_dtype(axes).itemsize
    assert found["sizes"] == [
        layout.HEADER.size,
        HEAD.size,
        PLACE.itemsize,
        MOTION.itemsize,
    ]
    assert found["limits"] == [layout.VERSION, PLACES, COMMANDS]
    assert found["magic"] == [layout.MAGIC.decode(), MAGIC.decode()]
    assert found["reasons"] == list(Reason)
