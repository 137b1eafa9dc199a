"""Files and firmware of twins: devices from a vendor's ESI or SII that lists FoE and BOOT."""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.bus.firmware import FirmwareUpdate
from catenary.bus.firmware_result import FirmwareOptions
from catenary.errors import FoeError, MailboxError, StateError
from catenary.types import VISIBLE_STRING
from catenary.virtual import (
    Device,
    DeviceFiles,
    DeviceFirmware,
    Segment,
    Twin,
    TwinOptions,
    make_firmware,
    read_segment,
)
from catenary.wire.sii import MailboxProtocol

ESI = "hpm_ECAT_FOE.xml"  # HPMicro's sample for FoE, made with Beckhoff's slave stack code
FILES = DeviceFiles(contents={"log.txt": "started"}, firmware=DeviceFirmware(name="ECATFW__"))


def from_esi(shared_data: Path, files: DeviceFiles | None = FILES) -> Twin:
    return Device.from_esi(shared_data / "esi" / ESI, options=TwinOptions(files=files))


def test_a_twin_of_a_vendor_updates_its_firmware(shared_data: Path) -> None:
    model = from_esi(shared_data)
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        assert sub.description.mailbox is not None
        assert MailboxProtocol.FOE in sub.description.mailbox.protocols
        assert sub.description.bootstrap is not None
        assert sub.description.bootstrap.source == "SII"
        assert sub.foe.read("log.txt") == b"started"
        with pytest.raises(FoeError, match="only in the state BOOT"):
            sub.foe.write("ECATFW__", b"")
        image = make_firmware(sub.identity.product, "5.1", size=10_000)
        result = FirmwareUpdate(main, 0, image, FirmwareOptions("ECATFW__", version="5.1")).run()
        assert result.error is None
        assert main.subs[0].sdo.read(0x100A, type=VISIBLE_STRING) == "5.1"


def test_a_twin_of_an_image_has_the_same_bootstrap_mailbox(shared_data: Path) -> None:
    image = from_esi(shared_data).sii_image()
    model = Device.from_sii(image, options=TwinOptions(files=FILES))
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        with sub.boot() as foe:
            foe.write("ECATFW__", make_firmware(sub.identity.product, "6"))
        assert sub.foe.read("log.txt") == b"started"


def test_a_twin_without_bootstrap_mailbox_has_no_boot(shared_data: Path) -> None:
    image = bytearray(from_esi(shared_data).sii_image())
    image[0x28:0x30] = bytes(8)
    path = shared_data / "esi" / ESI
    model = Device.from_sii(bytes(image), options=TwinOptions(files=FILES))
    with cat.MainDevice(Segment([model])) as main:
        [sub] = main.scan()
        assert sub.description.bootstrap is None
        [sub] = main.scan(esi=path)
        assert sub.description.bootstrap is not None  # that of the ESI
        assert ESI in sub.description.bootstrap.source
        with pytest.raises(StateError, match="Bootstrap not supported"), sub.boot():
            pass


def test_a_twin_without_files_refuses_foe(shared_data: Path) -> None:
    with cat.MainDevice(Segment([from_esi(shared_data, None)])) as main:
        [sub] = main.scan()
        with pytest.raises(MailboxError, match="protocol is not supported"):
            sub.foe.read("log.txt")


def test_files_of_a_twin_in_a_segment_file(shared_data: Path, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        f"""
[[device]]
kind = "esi"
esi = "{shared_data / "esi" / ESI}"
files = {{ contents = {{ "a.txt" = "text" }} }}
"""
    )
    with cat.MainDevice(read_segment(path)) as main:
        assert main.scan()[0].foe.read("a.txt") == b"text"
