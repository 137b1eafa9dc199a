"""ESI files with the kernel master: names and modes; the master keeps addresses and states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

import catenary as cat
from catenary.errors import ConfigurationError, SdoAbort
from catenary.esi.configured import with_reported_modules
from catenary.igh import Master
from catenary.igh.configure import start_up_downloads
from catenary.igh.describe import with_module_lists
from catenary.igh.reservation import Reservation
from catenary.plan.planner import make_plan
from tests.esi import servo_file
from tests.esi.modular import AI, DO, coupler
from tests.igh.double import Double
from tests.plan.test_modules import described, planned


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


class Objects:
    """Master that only reads objects of one device."""

    def __init__(self, objects: dict[tuple[int, int], bytes]) -> None:
        self.objects = objects

    def upload(self, position: int, index: int, subindex: int) -> bytes:
        if (index, subindex) not in self.objects:
            raise SdoAbort(
                "absent", position=position, index=index, subindex=subindex, code=0x0602_0000
            )
        return self.objects[index, subindex]


def test_the_reported_modules_count_more_than_the_default_ones() -> None:
    esi = coupler()
    assert esi.slots is not None
    esi = replace(esi, slots=replace(esi.slots, download_module_idents=True))
    idents = {(0xF050, 1): bytes([DO, 0, 0, 0]), (0xF050, 2): bytes([AI, 0, 0, 0])}
    master = cast(Reservation, Objects({(0xF050, 0): b"\x02", **idents}))
    device = with_reported_modules(with_module_lists(master, described(esi)), esi)
    assert device.modular is not None
    assert (device.modular.detected, device.modular.configured) == ((DO, AI), None)
    plan = make_plan([device]).devices[0].modules
    assert plan is not None
    assert plan.idents == (DO, AI)


def test_other_modules_than_the_detected_ones_are_refused() -> None:
    esi = coupler()
    [plan] = planned(described(esi, detected=(DO, AI, 0)), esi, ["8 DI"]).devices
    with pytest.raises(ConfigurationError, match=r"slot 0 .*: expected 8 DI .*, found 8 DO"):
        start_up_downloads(plan, "device 0")
