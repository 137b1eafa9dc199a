"""`catenary capture diff` compares the bring-ups of PySOEM and Catenary."""

from __future__ import annotations

import pathlib

import catenary as cat
import pytest
from tests.peers.sniffer import sniffing
from tests.peers.test_pysoem import opened, to_operational, again

pysoem = pytest.importorskip("pysoem", reason="PySOEM is not installed (extra `peers`)")


def test_x(served, tmp_path):
    a, b = tmp_path / "soem.pcapng", tmp_path / "ours.pcapng"
    with sniffing(served, a), opened(6, served) as master:
        to_operational(master)
    with sniffing(served, b), cat.MainDevice(served) as main:
        subs = main.scan()
        axes = cat.Drives(subs.drives, counts_per_turn=2**20, velocity_limit=1.0)
        with cat.Loop(
            axes,
            cat.ProcessData(subs[1]),
            cat.ProcessData(subs[4]),
            cat.ProcessData(subs[5]),
            period=5e-3,
        ) as loop:
            next(loop)
    import shutil

    shutil.copy(a, "/tmp/s5/")
    shutil.copy(b, "/tmp/s5/")
