"""Sensor device: its inputs are sensors of the plant's model, for example an IMU."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from catenary.errors import ConfigurationError
from catenary.virtual.coe.dictionary import MAP_TX, READ_ANY, REAL32
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import AppliedDevice, MailboxOptions
from catenary.virtual.scheduler import Scheduler
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks

STEP_NS = 250_000  # internal cycle
FIRST, STRIDE = 0x6000, 0x10  # object of the first sensor; distance to that of the next one
MOST = 16  # sensors per device
MOST_VALUES = 255  # values per device, as subindices of a PDO
SUFFIXES = {1: ("",), 3: (" x", " y", " z"), 4: (" w", " x", " y", " z")}


class ModelSensor(AppliedDevice):
    """Device that measures sensors of the plant's model. It has one TxPDO of REAL32 entries.

    The entries have the order of the sensors and their values. Their names are those of the
    sensors, with " x", " y" and " z" for vectors, and " w" for the real part of a quaternion.
    Object 0x60n0 contains the values of sensor n.

    Each step of the plant updates the values: shown = scale · (value + bias + noise). MuJoCo
    computes its sensors at the start of a step. The values are therefore one step old.
    """

    kind = "model_sensor"

    def __init__(
        self,
        *,
        sensors: Sequence[str],
        noise: Mapping[str, float] | None = None,
        bias: Mapping[str, float] | None = None,
        scale: Mapping[str, float] | None = None,
        seed: int = 0,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
        mailbox_bytes: int = 128,
        mailbox_delay: float = 300e-6,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
        mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
        sii_quirks: SiiQuirks = NO_SII_QUIRKS,
    ) -> None:
        """Initialise the device.

        Args:
            sensors: Names of 1 to 16 sensors of the model.
            noise: Standard deviation of the noise by sensor, in its SI unit. Default: no noise.
            bias: Constant error by sensor, in its SI unit. Default: no error.
            scale: Factor by sensor, for devices with other units. Default: 1.
            seed: Seed of the noise, 0 to 2^32 - 1.
            name: Device name; empty: a default name.
            alias: Station alias.
            serial: Serial number.
            lrw: True if the device supports LRW.
            mailbox_bytes: Size of each mailbox [bytes].
            mailbox_delay: Time until a request is answered [s].
            crystal: Frequency error and jitter of the clock.
            clock_bits: Width of the clock, 32 or 64.
            mailbox_quirks: Quirks of the mailbox.
            sii_quirks: Quirks of the SII.

        Raises:
            ValueError: A value is out of range, or an error is given for another sensor.
        """
        if isinstance(sensors, str):
            raise ValueError(f"sensors must be a sequence of names, not the string {sensors!r}")
        super().__init__(
            name=name or f"Catenary virtual sensor of {len(sensors)} quantities",
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=sii_quirks,
            mailbox=MailboxOptions(mailbox_bytes, mailbox_delay, mailbox_quirks),
        )
        self.sensors = tuple(sensors)
        self.noise = dict(noise or {})
        self.bias = dict(bias or {})
        self.scale = dict(scale or {})
        self.seed = seed
        self._sizes: dict[str, int] = {}
        self._check_values()

    def _check_values(self) -> None:
        """Raise ValueError if a value is out of range."""
        if not 1 <= len(set(self.sensors)) <= MOST:
            raise ValueError(f"sensors must be 1 to {MOST} names, not {self.sensors}")
        if len(set(self.sensors)) < len(self.sensors):
            raise ValueError(f"sensors contains a name twice: {', '.join(self.sensors)}")
        if not 0 <= self.seed < 1 << 32:
            raise ValueError(f"seed must be 0 to 2^32 - 1, not {self.seed}")
        for field in ("noise", "bias", "scale"):
            for sensor, value in getattr(self, field).items():
                if sensor not in self.sensors:
                    raise ValueError(f"{field}: {sensor!r} is not in sensors")
                if not math.isfinite(value) or (field == "noise" and value < 0):
                    raise ValueError(f"{field} of {sensor!r} is out of range: {value}")

    def measure(self, sizes: Mapping[str, int]) -> None:
        """Set the number of values of each sensor, before the device is added to a segment.

        Raises ConfigurationError if there are too many.
        """
        count = sum(sizes.values())
        if count > MOST_VALUES:
            raise ConfigurationError(
                f"{self.name} has {count} values from its sensors, but a device has at most"
                f" {MOST_VALUES}",
                hint="distribute the sensors over several devices",
            )
        self._sizes = dict(sizes)

    @property
    def sizes(self) -> Mapping[str, int]:
        """Number of values of each sensor. Raises ValueError without a plant."""
        if not self._sizes:
            raise ValueError(
                f"{self.name} needs a plant with the sensors {', '.join(self.sensors)}; use"
                " Segment(..., plant=Plant(...))"
            )
        return self._sizes

    def values(self) -> Iterator[tuple[str, int, int]]:
        """Yield (sensor, number of the value in the sensor, seed of its noise) for each entry."""
        entry = 0
        for sensor in self.sensors:
            for number in range(self.sizes[sensor]):
                yield sensor, number, self.seed << 16 | entry
                entry += 1

    def _entries(self, sensor: str) -> list[MappedEntry]:
        index, size = FIRST + STRIDE * self.sensors.index(sensor), self.sizes[sensor]
        suffixes = SUFFIXES.get(size) or [f" {n}" for n in range(size)]
        return [
            MappedEntry(index, n, 32, sensor + suffix, REAL32)
            for n, suffix in enumerate(suffixes, start=1)
        ]

    def description(self) -> Description:
        entries = tuple(entry for sensor in self.sensors for entry in self._entries(sensor))
        pdos = (Pdo(0x1A00, "Sensor values", entries, 3),)
        return Description(
            name=self.name,
            order=f"CVM{len(entries):03d}",
            group="Sensors",
            product_code=0x0006_0000 + len(entries),
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(self.mailbox_bytes),
            sync_managers=sync_managers_of(self.mailbox_bytes, (), pdos),
            fmmus=(1, 2, 3),
            rx_pdos=(),
            tx_pdos=pdos,
            clock=True,
            slots=len(entries),
            current_milliampere=150,
            lrw=self.lrw,
        )

    def started(self, scheduler: Scheduler) -> None:
        super().started(scheduler)
        self.core.run_model(self.position, STEP_NS)

    def add_objects(self, application: Application) -> None:
        slot = 0
        for n, sensor in enumerate(self.sensors):
            entries = []
            for mapped in self._entries(sensor):
                access = READ_ANY | MAP_TX
                entries.append(application.slot_entry(mapped.name, REAL32, 32, slot, access))
                slot += 1
            application.dictionary.add_record(FIRST + STRIDE * n, sensor, entries)
