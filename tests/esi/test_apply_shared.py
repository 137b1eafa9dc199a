"""ESI and SII of the same real devices: the ESI adds PDOs and modes, and contradicts nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.esi import Library
from catenary.esi.apply import applied
from catenary.model.describe import describe
from catenary.model.device import DeviceDescription, Direction
from catenary.plan.clocks import make_sync
from catenary.plan.planner import make_plan
from catenary.plan.request import DistributedClock

INFORMATION = bytes([0x11, 0, 2, 0, 8, 8, 8, 0b0000_1111, 0xFC, 0])
PAIRS = ("metalmusings_EaserCAT_2000", "metalmusings_EaserCAT_6000")


@pytest.fixture(params=PAIRS)
def pair(shared_data: Path, request: pytest.FixtureRequest) -> tuple[Path, DeviceDescription]:
    """Return the ESI file of a device, and the description from its SII."""
    image = (shared_data / "sii" / f"{request.param}.bin").read_bytes()
    device = describe(
        0,
        station_address=0x1001,
        alias=0,
        dl_status=0,
        information=INFORMATION,
        image=image,
        system_time=True,
    )
    return shared_data / "esi" / f"{request.param}.xml", device


def test_the_esi_has_the_process_data_that_the_sii_lacks(
    pair: tuple[Path, DeviceDescription],
) -> None:
    path, device = pair
    with Library.of(path) as library:
        esi = library.find(*device.identity[:3])
    assert esi is not None
    completed = applied(device, esi)
    assert completed.notes == ()
    places = [(each.index, each.start) for each in device.sync_managers]
    assert [(each.index, each.start) for each in completed.sync_managers] == places
    for direction in Direction:
        assert device.assignments(direction) == ()
        [assignment] = completed.assignments(direction)
        assert assignment.pdos == completed.pdos(direction)
        assert all(
            entry.name and entry.data_type for pdo in assignment.pdos for entry in pdo.entries
        )
    assert f"mapping from ESI {path}" in str(make_plan([completed]))


def test_the_mode_is_found_by_its_description(pair: tuple[Path, DeviceDescription]) -> None:
    path, device = pair
    with Library.of(path) as library:
        esi = library.find(*device.identity[:3])
    assert esi is not None
    clock = DistributedClock(op_mode="DC-Synchron")
    sync = make_sync(applied(device, esi), clock, 1_000_000)
    assert (sync.op_mode, sync.assign_activate, sync.cycle_ns) == ("DC", 0x0300, 1_000_000)
    assert sync.source.startswith(f"ESI {path}:")
