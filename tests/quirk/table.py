"""Table of quirks: name → segment with a device that has the quirk.

Every segment has a coupler, a digital output, the device with the quirk (position 2) and a servo
without quirks (position 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from catenary.drive import DistributedClock
from catenary.virtual import (
    Coupler,
    Device,
    DeviceFiles,
    DigitalOutputs,
    MailboxQuirks,
    MappingQuirks,
    Segment,
    Servo,
    ServoQuirks,
    SiiQuirks,
)
from catenary.virtual.op_modes import EASYCAT, EASYCAT_STORED, EL3702, SYNC1_ALONE

QUIRKY, SOUND = 2, 3  # positions
CONTROL = "\x1b[2J\r\n\x07\x9b"  # clear screen, carriage return, bell and a C1 sequence


@dataclass(frozen=True)
class Quirk:
    """A device with a quirk, and the functions that the quirk prevents."""

    make: Callable[[], Device]
    broken: str = ""  # part of the error if the device cannot reach PRE-OP
    moves: bool = True  # True if it follows its targets
    notes: str = ""  # part of a note from the scan
    clock: DistributedClock | bool = True  # `dc=` that its SII requires

    def segment(self) -> Segment:
        return Segment([Coupler(), DigitalOutputs(), self.make(), Servo(serial=2)])


def servo(**quirks: object) -> Callable[[], Device]:
    """Return a servo that differs from CiA 402."""
    return lambda: Servo(serial=1, quirks=ServoQuirks(**quirks))  # type: ignore[arg-type]


def mailbox(**quirks: object) -> Callable[[], Device]:
    """Return a servo with a mailbox that differs from ETG.1000.6."""
    return lambda: Servo(serial=1, mailbox_quirks=MailboxQuirks(**quirks))  # type: ignore[arg-type]


def sii(**quirks: object) -> Callable[[], Device]:
    """Return a servo with an SII that differs from ETG.2010."""
    return lambda: Servo(serial=1, sii_quirks=SiiQuirks(**quirks))  # type: ignore[arg-type]


def mapping(**quirks: object) -> Callable[[], Device]:
    """Return a servo with PDOs that differ from ETG.1000.6."""
    return lambda: Servo(serial=1, mapping_quirks=MappingQuirks(**quirks))  # type: ignore[arg-type]


def device(**options: object) -> Callable[[], Device]:
    """Return a servo with rare options that are not quirks."""
    return lambda: Servo(serial=1, **options)  # type: ignore[arg-type]


QUIRKS: dict[str, Quirk] = {
    "none": Quirk(servo()),
    # CiA 402
    "bit 12 never": Quirk(servo(bit_12="never"), moves=False),
    "bit 12 never, follows": Quirk(servo(bit_12="never", follows_without_bit_12=True)),
    "ignores quick stop": Quirk(servo(ignores_quick_stop=True)),
    "ignores disable": Quirk(servo(ignores_disable=True)),
    "quick stop 0": Quirk(servo(quick_stop_option=0)),
    "quick stop -1": Quirk(servo(quick_stop_option=-1)),
    "quick stop absent": Quirk(servo(quick_stop_option="absent")),
    "abort connection 0": Quirk(servo(abort_connection_option=0)),
    "mode delay": Quirk(servo(mode_delay=0.05)),
    "CST refused": Quirk(servo(refused_modes=(10,))),
    "watchdog trigger clear": Quirk(servo(watchdog_trigger=False)),
    "checks watchdog": Quirk(servo(checks_watchdog=True)),
    # mailbox and dictionary
    "counter echoed": Quirk(mailbox(counter="echoed")),
    "counter stuck": Quirk(mailbox(counter="stuck")),
    "counter zero": Quirk(mailbox(counter="zero")),
    "aborts uncounted": Quirk(mailbox(uncounted_aborts=True)),
    "list cut short": Quirk(mailbox(object_list="missing")),
    "list not continued": Quirk(mailbox(object_list="promised")),
    "descriptions malformed": Quirk(mailbox(malformed_descriptions=(0x1008, 0x6041, 0x6064))),
    "descriptions missing": Quirk(mailbox(missing_descriptions=(0x1008, 0x6041))),
    "mailbox errors": Quirk(mailbox(error_reply="unsupported"), broken="protocol is not supported"),
    "mailbox errors malformed": Quirk(mailbox(error_reply="short"), broken="without a valid code"),
    "uploads drip": Quirk(mailbox(drip=True)),
    "control characters": Quirk(mailbox(text_prefix=CONTROL)),
    # SII
    "mailbox of 65535 bytes": Quirk(sii(mailbox_size=65535), broken="0x0016", notes="65535 bytes"),
    "mailbox of 8 bytes": Quirk(sii(mailbox_size=8), broken="0x0016", notes="of 8 bytes"),
    "17 SyncManagers": Quirk(sii(sync_managers=17), notes="17 SyncManagers"),
    "PDOs unnamed": Quirk(sii(pdos="unnamed")),
    "PDOs not in the SII": Quirk(sii(pdos="absent")),
    "control characters in the SII": Quirk(sii(text_prefix=CONTROL)),
    # process data
    "PDOs fixed": Quirk(mapping(fixed_pdos="declared")),
    "PDOs fixed, not declared": Quirk(mapping(fixed_pdos="silent")),
    "PDOs and lists fixed": Quirk(mapping(fixed_pdos="silent", fixed_lists="silent")),
    "other PDOs at power-up": Quirk(mapping(power_up=(0x1601, 0x1A01))),
    "PDOs exclude each other": Quirk(mapping(exclusive=True)),
    "mode cannot be mapped": Quirk(mapping(refused_objects=(0x6060, 0x6061))),
    "CoE details deny PDO changes": Quirk(mapping(coe_details=0x23)),
    # clocks
    "SYNC1 alone": Quirk(servo(op_modes=SYNC1_ALONE, sync_signal="sync1")),
    "SYNC1 once a period": Quirk(servo(op_modes=EL3702[2:], sync_signal="sync1")),
    "shift of 2 s": Quirk(servo(op_modes=EASYCAT), clock=DistributedClock(shift=0.0)),
    "AssignActivate 0": Quirk(servo(op_modes=EASYCAT_STORED)),
    "ports cannot be closed": Quirk(servo(closes_ports=False)),
    # rare
    "LRD and LWR only": Quirk(device(lrw=False)),
    "clock of 32 bits": Quirk(device(clock_bits=32)),
    "slow mailbox": Quirk(device(mailbox_delay=0.05)),
    "mailbox of 32 bytes": Quirk(device(mailbox_bytes=32)),
    "mailbox of 1024 bytes": Quirk(device(mailbox_bytes=1024)),
    "files": Quirk(device(files=DeviceFiles())),
    "files as SOES serves them": Quirk(
        device(files=DeviceFiles(error_texts=False, second_request="refused", new_files=False))
    ),
}
