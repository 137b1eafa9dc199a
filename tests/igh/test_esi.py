"""ESI files with the kernel master: names and modes; the master keeps addresses and states."""

from __future__ import annotations

from pathlib import Path

import catenary as cat
from catenary.igh import Master
from tests.esi import servo_file
from tests.igh.double import Double


def test_a_scan_and_a_plan_with_an_esi(double: Double, tmp_path: Path) -> None:
    commands = servo_file.command(0x2010, "0500") + servo_file.command(0x2011, "0600", "SO")
    path = servo_file.write(tmp_path, vendor=0xAA, product=0x402, number=1, commands=commands)
    with cat.MainDevice(Master(library=double.path, virtual_time=True)) as main:
        subs = main.scan(esi=path)
        assert all(sub.esi is not None for sub in subs)
        assert subs[0].description.mapping_source == "IgH master"
        assert "ESI 6041" in [row.name for row in subs[0].pdos]
        clock = cat.DistributedClock(op_mode="DC-Synchron")
        plan = main.plan(cat.ProcessData(subs[0], dc=clock))
        assert f"source: ESI {servo_file.line_of(path, '<Name>DC</Name>')}" in str(plan.clocks)
        main.configure(plan)
    written = [line for line in double.calls() if "config_sdo" in line]
    assert any("2010" in line for line in written)
    assert any("2011" in line for line in written)
