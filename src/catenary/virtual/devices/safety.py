"""Safety logic and safety terminal. A MainDevice relays their frames.

Their protocol is a simplified FSoE (virtual/fsoe): it shows the effects of a relay, and does not
conform to ETG.5100. The process data has the layout of real devices, such as the EL1904: a PDO with
command, safety data, CRCs and connection ID in each direction.
"""

from __future__ import annotations

from catenary.virtual.description import Description, MappedEntry, Pdo, SyncManagerDefault
from catenary.virtual.devices.device import Device
from catenary.virtual.fsoe import MainInstance, SafetyState, SubInstance
from catenary.virtual.scheduler import Scheduler

UNSIGNED8, UNSIGNED16 = 5, 6
STEP_NS = 500_000  # internal cycle
OUTPUTS_AT, INPUTS_AT = 0x1000, 0x1800
CONNECTIONS_MAX = 4
SIZE_MAX = 4  # safety data in a frame [bytes]


def _entries(index: int, size: int, label: str) -> tuple[MappedEntry, ...]:
    """Return the entries of one frame, in the order of ETG.5100."""
    entries = [MappedEntry(index, 1, 8, f"{label} CMD", UNSIGNED8)]
    width = min(size, 2)
    for block in range((size + 1) // 2):
        for byte in range(width):
            number = block * 2 + byte
            entries.append(
                MappedEntry(index + 1, number + 1, 8, f"{label} Data {number}", UNSIGNED8)
            )
        entries.append(MappedEntry(index, 3 + block, 16, f"{label} CRC_{block}", UNSIGNED16))
    entries.append(MappedEntry(index, 2, 16, f"{label} ConnID", UNSIGNED16))
    return tuple(entries)


class _SafetyDevice(Device):
    """Device with safety frames of one size as its process data."""

    order = ""
    sends, receives = "", ""  # names of its frames
    product = 0

    def __init__(
        self, *, frames: int, size: int, name: str, alias: int, serial: int, lrw: bool
    ) -> None:
        if size not in (1, *range(2, SIZE_MAX + 1, 2)):
            raise ValueError(f"size must be 1, 2 or {SIZE_MAX}, not {size}")
        super().__init__(name=name, alias=alias, serial=serial, lrw=lrw)
        self.size = size
        self._frames = frames
        self._bytes = sum(entry.bits for entry in _entries(0, size, "")) // 8  # of a frame
        self._last = bytes(frames * self._bytes)

    def description(self) -> Description:
        total = self._frames * self._bytes
        return Description(
            name=self.name,
            order=self.order,
            group="Safety",
            product_code=self.product + 0x10 * self._frames + self.size,
            serial=self.serial,
            alias=self.alias,
            emulation=True,
            pdi_type=0x04,
            mailbox=None,
            sync_managers=(
                SyncManagerDefault(OUTPUTS_AT, total, 0x64, 0x01, 3),
                SyncManagerDefault(INPUTS_AT, total, 0x20, 0x01, 4),
            ),
            fmmus=(1, 2),
            rx_pdos=self._pdos(0x1600, 0x7000, self.receives, 0),
            tx_pdos=self._pdos(0x1A00, 0x6000, self.sends, 1),
            clock=False,
            ram=0x1000,
            slots=total,
            current_milliampere=90,
            lrw=self.lrw,
        )

    def _pdos(self, first: int, index: int, name: str, channel: int) -> tuple[Pdo, ...]:
        """Return the PDO of each frame of a direction.

        Args:
            first: Index of the first PDO.
            index: Index of its objects.
            name: Name of its frame.
            channel: SyncManager of the direction.
        """
        labels = [f"{name} {k + 1}" if self._frames > 1 else name for k in range(self._frames)]
        return tuple(
            Pdo(first + k, label, _entries(index + 0x10 * k, self.size, label), channel, fixed=True)
            for k, label in enumerate(labels)
        )

    def started(self, scheduler: Scheduler) -> None:
        total = self._frames * self._bytes
        self._last = bytes(total)
        self.core.map_process_data(
            self.position, False, 1, [(8 * k, 8, k, False) for k in range(total)]
        )
        self._restart()

        def step() -> None:
            self._step(scheduler.now)
            scheduler.after(STEP_NS, step)

        step()

    def _step(self, now_ns: int) -> None:
        """Process the received frames, and show the frames to send."""
        if self.core.outputs_valid(self.position):
            self._last = self.core.output_image(self.position, 0) or self._last
        received = [
            self._last[k * self._bytes : (k + 1) * self._bytes] for k in range(self._frames)
        ]
        for slot, byte in enumerate(b"".join(self._answer(now_ns, received))):
            self.core.put_slot(self.position, slot, byte)
        self.core.refresh_inputs(self.position)

    def _restart(self) -> None:
        """Begin without a connection, after power-on."""
        raise NotImplementedError

    def _answer(self, now_ns: int, received: list[bytes]) -> list[bytes]:
        """Return the frames to send.

        Args:
            now_ns: Time of the segment [ns].
            received: Frame that each connection holds at present.
        """
        raise NotImplementedError


class SafetyLogic(_SafetyDevice):
    """Safety logic with an FSoE MainInstance for each connection.

    `connections[k]` has the connection ID k + 1, and connects to the safety address k + 1. Its safe
    outputs follow its safe inputs: each connection receives its own safe inputs back.
    """

    kind = "safety_logic"
    order, product = "CVSL", 0x0007_0000
    sends, receives = "FSoE main frame", "FSoE sub frame"

    def __init__(
        self,
        *,
        connections: int = 1,
        size: int = 2,
        watchdog: float = 0.1,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
    ) -> None:
        """Initialise the device.

        Args:
            connections: Number of connections, 1 to 4.
            size: Safety data in each frame, 1, 2 or 4 [bytes].
            watchdog: Watchdog time of all connections [s].
            name: Device name; empty: a default name.
            alias: Station alias.
            serial: Serial number.
            lrw: True if the device supports LRW.

        Raises:
            ValueError: A value is out of range.
        """
        if not 1 <= connections <= CONNECTIONS_MAX:
            raise ValueError(f"connections must be 1 to {CONNECTIONS_MAX}, not {connections}")
        if not 1e-3 <= watchdog <= 65.535:
            raise ValueError(f"watchdog must be 1 ms to 65.535 s, not {watchdog} s")
        super().__init__(
            frames=connections,
            size=size,
            name=name or "Catenary virtual safety logic",
            alias=alias,
            serial=serial,
            lrw=lrw,
        )
        self.watchdog = watchdog
        self.connections: list[MainInstance] = []
        self._restart()

    def _restart(self) -> None:
        watchdog_ns = round(self.watchdog * 1000) * 1_000_000
        self.connections = [
            MainInstance(self.size, k + 1, k + 1, watchdog_ns) for k in range(self._frames)
        ]

    def _answer(self, now_ns: int, received: list[bytes]) -> list[bytes]:
        for main, frame in zip(self.connections, received, strict=True):
            main.outputs = main.inputs
            main.step(now_ns, frame)
        return [main.frame for main in self.connections]

    @property
    def states(self) -> list[SafetyState]:
        """State of each connection."""
        return [main.state for main in self.connections]


class SafetyTerminal(_SafetyDevice):
    """Safety terminal with an FSoE SubInstance: `safe_inputs` to send, `safe_outputs` received."""

    kind = "safety_terminal"
    order, product = "CVST", 0x0008_0000
    sends, receives = "FSoE sub frame", "FSoE main frame"

    def __init__(
        self,
        *,
        address: int = 1,
        size: int = 2,
        name: str = "",
        alias: int = 0,
        serial: int = 0,
        lrw: bool = True,
    ) -> None:
        """Initialise the device.

        Args:
            address: Safety address, 1 to 0xFFFF.
            size: Safety data in each frame, 1, 2 or 4 [bytes].
            name: Device name; empty: a default name.
            alias: Station alias.
            serial: Serial number.
            lrw: True if the device supports LRW.

        Raises:
            ValueError: A value is out of range.
        """
        if not 1 <= address <= 0xFFFF:
            raise ValueError(f"address must be 1 to 65535, not {address}")
        super().__init__(
            frames=1,
            size=size,
            name=name or "Catenary virtual safety terminal",
            alias=alias,
            serial=serial,
            lrw=lrw,
        )
        self.address = address
        self.safe_inputs = bytes(size)
        self.connection = SubInstance(size, address)

    def _restart(self) -> None:
        self.connection = SubInstance(self.size, self.address)

    def _answer(self, now_ns: int, received: list[bytes]) -> list[bytes]:
        self.connection.inputs = self.safe_inputs
        self.connection.step(now_ns, received[0])
        return [self.connection.frame]

    @property
    def safe_outputs(self) -> bytes:
        """Safe outputs; zeros unless the connection is in DATA."""
        return self.connection.outputs
