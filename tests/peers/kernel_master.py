"""Simulation of the IgH kernel master (EtherLab 1.6): its frames, and the answers that it requires.

It is written from the behaviour of the state machines. Each function names the file and functions
that it simulates. One tick is one real-time cycle of 1 ms: one frame with the domains, the clock
datagrams and at most one datagram of a state machine. A `Complaint` is an error in the kernel log.
The frames are encoded here and not by `catenary.wire`, so that the check is independent.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from catenary.virtual import Segment

APRD, APWR, FPRD, FPWR, BRD, BWR, LRD, LWR, LRW, FRMW = 1, 2, 4, 5, 7, 8, 10, 11, 12, 14
INIT, PRE_OP, SAFE_OP, OP, ERROR = 1, 2, 4, 8, 0x10
TICK_NS = 1_000_000
FIRST_CATEGORY = 0x40
CATEGORY_GENERAL, CATEGORY_SYNC = 30, 41
COE = 3
RESPONSE_MS = 5000  # EC_FSM_COE_*_TIMEOUT are 3 s and more
APP_EPOCH = 848_540_000_000_000_000  # application time at start: ns since 2000


class Complaint(AssertionError):
    """Error that the master would log."""


def demand(condition: bool, what: str) -> None:
    if not condition:
        raise Complaint(what)


class Abort(Exception):
    """An SDO abort, which is a regular answer."""

    def __init__(self, code: int) -> None:
        super().__init__(hex(code))
        self.code = code


@dataclass
class Datagram:
    command: int
    address: int  # as in the header
    data: bytes
    counter: int = 0


@dataclass
class Sync:
    start: int
    length: int
    control: int
    enable: int

    @property
    def is_output(self) -> bool:
        return self.control & 0x0C == 0x04

    def page(self, size: int, *, transfers: bool) -> bytes:
        """sync.c, ec_sync_page."""
        enable = (self.enable & 1 or transfers) and size and not self.enable & 4
        return struct.pack("<HHBBH", self.start, size, self.control, 0, 1 if enable else 0)


@dataclass
class Slave:
    position: int
    station: int
    state: int = 0
    fmmu_count: int = 0
    sync_count: int = 0
    has_dc: bool = False
    dc_64: bool = False
    port_times: tuple[int, ...] = ()
    dl_status: int = 0
    delay: int = 0
    sii: bytes = b""
    syncs: list[Sync] = field(default_factory=list)
    mailbox_protocols: int = 0
    sdo_information: bool = False
    rx: tuple[int, int] = (0, 0)  # mailbox, as configured
    tx: tuple[int, int] = (0, 0)
    pdos: dict[int, dict[int, list[int]]] = field(default_factory=dict)  # sync: PDO: entries

    def word(self, address: int) -> int:
        return int.from_bytes(self.sii[2 * address : 2 * address + 2], "little")

    def size(self, sync: int) -> int:
        """Return the size of the process data of a SyncManager [bytes]."""
        if sync not in self.pdos:
            return self.syncs[sync].length
        bits = sum(e & 0xFF for entries in self.pdos[sync].values() for e in entries)
        return (bits + 7) // 8


@dataclass
class Part:
    """Data that one FMMU of a domain transfers (domain.c, slave_config.c)."""

    slave: Slave
    sync: int
    logical: int
    size: int
    is_output: bool

    def page(self) -> bytes:
        """fmmu_config.c, ec_fmmu_config_page."""
        start = self.slave.syncs[self.sync].start
        kind = 2 if self.is_output else 1
        return struct.pack("<IHBBHBBHH", self.logical, self.size, 0, 7, start, 0, kind, 1, 0)


class Domain:
    """Owns a process image: its parts, its datagram and its counter (datagram_pair.c)."""

    def __init__(self, logical: int) -> None:
        self.logical = logical
        self.parts: list[Part] = []
        self.image = bytearray()
        self.counter = 0

    def add(self, slave: Slave) -> None:
        for number, sync in enumerate(slave.syncs):
            if (number < 2 and slave.mailbox_protocols) or not slave.size(number):
                continue
            start = self.logical + len(self.image)
            part = Part(slave, number, start, slave.size(number), sync.is_output)
            self.parts.append(part)
            self.image += bytes(part.size)

    def slice(self, slave: Slave, *, output: bool) -> slice:
        [part] = [p for p in self.parts if p.slave is slave and p.is_output is output]
        return slice(part.logical - self.logical, part.logical - self.logical + part.size)

    @property
    def _users(self) -> tuple[int, int]:
        outputs = {p.slave.position for p in self.parts if p.is_output}
        inputs = {p.slave.position for p in self.parts if not p.is_output}
        return len(outputs), len(inputs)

    @property
    def expected(self) -> int:
        outputs, inputs = self._users
        return 2 * outputs + inputs if outputs and inputs else outputs + inputs

    def datagram(self) -> Datagram:
        outputs, inputs = self._users
        command = LRW if outputs and inputs else LWR if outputs else LRD
        return Datagram(command, self.logical, bytes(self.image))

    def take(self, answer: Datagram) -> None:
        """Take the counter, and the data if it is not 0 (domain.c, ecrt_domain_process)."""
        self.counter = answer.counter
        if answer.command != LWR and answer.counter:
            self.image[:] = answer.data


class KernelMaster:
    """Owns the link, the cyclic frames and one datagram of a state machine per tick."""

    def __init__(self, segment: Segment) -> None:
        self.link = segment.open_link()
        self.start_ns: int = self.link.now()
        self.domains: list[Domain] = []
        self.clock: Slave | None = None  # reference clock
        self.slaves: list[Slave] = []
        self._index = 0
        self._due = self.link.now()

    def close(self) -> None:
        self.link.close()

    @property
    def app_time(self) -> int:
        now: int = self.link.now()
        return APP_EPOCH + now - self.start_ns

    # -- frames (master.c: ec_master_send_datagrams, ec_master_receive_datagrams)

    def tick(self, *extra: Datagram) -> list[Datagram]:
        """Run one cycle, and return the answers to `extra`."""
        cyclic = [domain.datagram() for domain in self.domains]
        sync: list[Datagram] = []
        if self.clock is not None:
            now = (self.app_time & 0xFFFFFFFF).to_bytes(4, "little")
            address = self.clock.station | 0x0910 << 16
            sync = [Datagram(FPWR, address, now), Datagram(FRMW, address, bytes(4))]
        answers = self._frame([*extra, *cyclic, *sync])
        for domain, answer in zip(self.domains, answers[len(extra) :], strict=False):
            domain.take(answer)
        self._due += TICK_NS
        while self.link.now() < self._due:
            self.link.wait_until(self._due, False)
        return answers[: len(extra)]

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick()

    def ask(self, command: int, place: int, register: int, data: bytes | int) -> Datagram:
        """Send a datagram of a state machine. An integer as data is the number of bytes to read."""
        content = bytes(data) if isinstance(data, int) else data
        [answer] = self.tick(Datagram(command, place & 0xFFFF | register << 16, content))
        return answer

    def ask_one(self, command: int, place: int, register: int, data: bytes | int) -> bytes:
        answer = self.ask(command, place, register, data)
        demand(answer.counter == 1, f"0x{register:04X} at {place}: counter {answer.counter}")
        return answer.data

    def _frame(self, datagrams: list[Datagram]) -> list[Datagram]:
        if not datagrams:
            return []
        payload, indices = b"", []
        for rank, d in enumerate(datagrams):
            self._index = self._index + 1 & 0xFF
            indices.append(self._index)
            more = 0x8000 if rank < len(datagrams) - 1 else 0
            head = struct.pack("<BBIHH", d.command, self._index, d.address, len(d.data) | more, 0)
            payload += head + d.data + bytes(2)
        frame = b"\xff" * 6 + b"\x02\0\0\0\0\1" + b"\x88\xa4"
        frame += struct.pack("<H", len(payload) | 0x1000) + payload
        self.link.send(frame.ljust(60, b"\0"))
        back = self.link.receive()
        deadline = self.link.now() + 900_000
        while back is None and self.link.now() < deadline:
            self.link.wait_until(deadline, True)
            back = self.link.receive()
        demand(back is not None, "a datagram timed out")
        assert back is not None
        return self._answers(back, datagrams, indices)

    @staticmethod
    def _answers(back: bytes, sent: list[Datagram], indices: list[int]) -> list[Datagram]:
        at, answers = 16, []
        for d, index in zip(sent, indices, strict=True):
            command, number, address, size, _ = struct.unpack_from("<BBIHH", back, at)
            # matched by index, type and size alone
            demand((command, number, size & 0x7FF) == (d.command, index, len(d.data)), "unmatched")
            data = back[at + 10 : at + 10 + len(d.data)]
            [counter] = struct.unpack_from("<H", back, at + 10 + len(d.data))
            answers.append(Datagram(command, address, data, counter))
            at += 12 + len(d.data)
        return answers

    # -- scanning (fsm_master.c, fsm_slave_scan.c)

    def broadcast(self) -> tuple[int, int]:
        """Return the number of devices and their states (ec_fsm_master_state_broadcast)."""
        answer = self.ask(BRD, 0, 0x0130, 2)
        return answer.counter, answer.data[0]

    def scan(self) -> list[Slave]:
        """Find and scan all devices, from the broadcast on."""
        count, _ = self.broadcast()
        cleared = self.ask(BWR, 0, 0x0010, bytes(2))
        demand(cleared.counter == count, "failed to clear station addresses")
        self.ask(BWR, 0, 0x0900, bytes(1))
        self.slaves = [self._scan_slave(position) for position in range(count)]
        self._calculate_delays()
        return self.slaves

    def _scan_slave(self, position: int) -> Slave:
        slave = Slave(position, position + 1)
        self.ask_one(APWR, -position, 0x0010, struct.pack("<H", slave.station))
        slave.state = self.ask_one(FPRD, slave.station, 0x0130, 2)[0]
        self._scan_base(slave)
        [slave.dl_status] = struct.unpack("<H", self.ask_one(FPRD, slave.station, 0x0110, 2))
        self.ask_one(FPWR, slave.station, 0x0500, bytes(1))  # with EC_SII_ASSIGN
        self._read_sii(slave)
        if slave.mailbox_protocols & 4:
            self._scan_dictionary(slave)
        return slave

    def _scan_base(self, slave: Slave) -> None:
        """ec_fsm_slave_scan_state_base, _dc_cap, _dc_times."""
        base = self.ask_one(FPRD, slave.station, 0x0000, 12)
        slave.fmmu_count, slave.sync_count = base[4], base[5]
        demand(base[4] <= 16 and base[5] <= 16, "more FMMUs or sync managers than the master has")
        demand(base[7] & 0x03 in (2, 3), "port 0 is neither EBUS nor MII")
        if not base[8] & 0x04:
            return
        slave.dc_64 = bool(base[8] & 0x08)
        capable = self.ask(FPRD, slave.station, 0x0910, 8 if slave.dc_64 else 4)
        demand(capable.counter in (0, 1), "system time cannot be determined")
        slave.has_dc = capable.counter == 1
        times = self.ask_one(FPRD, slave.station, 0x0900, 16)
        slave.port_times = struct.unpack("<4I", times)

    def read_sii(self, slave: Slave, word: int) -> bytes:
        """fsm_sii.c, reading: two words."""
        self.ask_one(FPWR, slave.station, 0x0502, struct.pack("<BBH", 0x80, 0x01, word))
        for _ in range(22):  # SII_TIMEOUT is 20 ms; one more try
            answer = self.ask_one(FPRD, slave.station, 0x0502, 10)
            demand(not answer[1] & 0x20, f"error on SII command, word 0x{word:04X}")
            if not answer[1] & 0x81:
                return answer[6:10]
        raise Complaint("SII: read timeout")

    def write_sii(self, slave: Slave, word: int, value: int) -> None:
        """fsm_sii.c, writing: one word; the status is valid after 5 ms."""
        command = struct.pack("<BBHHH", 0x81, 0x02, word, 0, value)
        self.ask_one(FPWR, slave.station, 0x0502, command)
        for tick in range(22):
            status = self.ask_one(FPRD, slave.station, 0x0502, 2)[1]
            demand(not status & 0x20, "error on SII command")
            if tick >= 5 and not status & 0x82:
                demand(not status & 0x40, "SII: write operation failed")
                return
        raise Complaint("SII: write timeout")

    def _read_sii(self, slave: Slave) -> None:
        """ec_fsm_slave_scan_state_sii_size, _sii_data."""
        offset = FIRST_CATEGORY
        while True:
            kind, size = struct.unpack("<HH", self.read_sii(slave, offset))
            if kind == 0xFFFF:
                break
            offset += 2 + size
            demand(offset < 4096, "SII size exceeds 4096 words (0xffff limiter missing?)")
        image = b"".join(self.read_sii(slave, word) for word in range(0, offset + 1, 2))
        slave.sii = image[: 2 * (offset + 1)]
        slave.mailbox_protocols = slave.word(0x1C)
        boxes = [slave.word(word) for word in (*range(0x14, 0x1C),)]
        demand(0xFFFF not in boxes, "invalid mailbox settings in SII")
        self._evaluate_categories(slave, offset)

    @staticmethod
    def _evaluate_categories(slave: Slave, end: int) -> None:
        at = FIRST_CATEGORY
        while at < end:
            kind, size = slave.word(at) & 0x7FFF, slave.word(at + 1)
            content = slave.sii[2 * (at + 2) : 2 * (at + 2 + size)]
            if kind == CATEGORY_SYNC:
                demand(len(content) % 8 == 0, "invalid SII sync manager category size")
                slave.syncs = [
                    Sync(start, length, control, enable)
                    for start, length, control, _, enable, _ in struct.iter_unpack(
                        "<HHBBBB", content
                    )
                ]
            elif kind == CATEGORY_GENERAL:
                demand(len(content) == 32, "wrong size of the general category")
                slave.sdo_information = bool(content[5] & 2)
            at += 2 + size

    def _scan_dictionary(self, slave: Slave) -> None:
        """ec_fsm_slave_scan_enter_preop, _state_sync, _state_pdos."""
        if slave.state & 0x0F in (PRE_OP, SAFE_OP, OP):
            page = self.ask_one(FPRD, slave.station, 0x0800, 16)
            rx_at, rx_size, tx_at, tx_size = struct.unpack("<HH4xHH4x", page)
            demand(0xFFFF not in (rx_size, tx_size), "invalid mailbox size configured")
            slave.rx, slave.tx = (rx_at, rx_size), (tx_at, tx_size)
        else:
            self.to_pre_op(slave)
        self.read_pdos(slave)

    def read_pdos(self, slave: Slave) -> None:
        """fsm_pdo.c and fsm_pdo_entry.c, reading."""
        for number in range(2, len(slave.syncs)):
            assigned = self._list(slave, 0x1C10 + number, 2)
            slave.pdos[number] = {pdo: self._list(slave, pdo, 4) for pdo in assigned}

    def _list(self, slave: Slave, index: int, size: int) -> list[int]:
        count = self.upload(slave, index, 0)
        demand(len(count) == 1, f"invalid data size of 0x{index:04X}:00")
        items = [self.upload(slave, index, sub) for sub in range(1, count[0] + 1)]
        demand(all(len(item) == size for item in items), f"invalid data size in 0x{index:04X}")
        return [int.from_bytes(item, "little") for item in items]

    def _calculate_delays(self) -> None:
        """slave.c, ec_slave_calc_port_delays_rec and ec_slave_calc_transmission_delays_rec.

        In a line, a delay is half the difference of the round trips of a device and the next clock.
        """
        clocks = [slave for slave in self.slaves if slave.has_dc]
        trips = [(c.port_times[1] - c.port_times[0]) & 0xFFFFFFFF for c in clocks]
        trips = [t if c.dl_status & 1 << 5 else 0 for t, c in zip(trips, clocks, strict=True)]
        for k in range(1, len(clocks)):
            clocks[k].delay = clocks[k - 1].delay + (trips[k - 1] - trips[k]) // 2

    # -- states (fsm_change.c)

    def change(self, slave: Slave, state: int) -> None:
        """ec_fsm_change_state_start to _status. A refusal is acknowledged, and is a Complaint."""
        before = slave.state
        for attempt in range(3000):
            answer = self.ask(FPWR, slave.station, 0x0120, struct.pack("<H", state))
            demand(answer.counter <= 1, f"failed to set state {state}")
            if answer.counter:
                break
            demand(attempt < 2999, f"failed to set state {state}")
        for _ in range(5000 if state <= PRE_OP else 10000):
            slave.state = self.ask_one(FPRD, slave.station, 0x0130, 2)[0]
            if slave.state == state:
                return
            if slave.state != before:
                if slave.state & 0x0F != before & 0x0F:
                    before = slave.state  # changed in the meantime: check again
                    continue
                code = self.acknowledge(slave)
                raise Complaint(f"refused state {state}, AL status code 0x{code:04X}")
        raise Complaint(f"timeout while setting state {state}")

    def acknowledge(self, slave: Slave) -> int:
        """Return the AL status code (ec_fsm_change_state_start_code to _check_ack)."""
        code = self.ask_one(FPRD, slave.station, 0x0134, 2)
        self.ask_one(FPWR, slave.station, 0x0120, struct.pack("<H", slave.state))
        for _ in range(500):
            slave.state = self.ask_one(FPRD, slave.station, 0x0130, 2)[0]
            if not slave.state & ERROR:
                return int.from_bytes(code, "little")
        raise Complaint("timeout while acknowledging state")

    # -- configuration (fsm_slave_config.c)

    def to_pre_op(self, slave: Slave) -> None:
        """ec_fsm_slave_config_enter_init to _state_boot_preop."""
        self.change(slave, INIT)
        if slave.fmmu_count:
            self.ask_one(FPWR, slave.station, 0x0600, bytes(16 * slave.fmmu_count))
        if slave.sync_count:
            self.ask_one(FPWR, slave.station, 0x0800, bytes(8 * slave.sync_count))
        if slave.has_dc:
            self.ask(FPWR, slave.station, 0x0980, bytes(2))  # may fail on simple devices
        if slave.mailbox_protocols:
            pages = b"".join(s.page(s.length, transfers=False) for s in slave.syncs[:2])
            pages = pages.ljust(8 * len(slave.syncs), b"\0")
            self.ask_one(FPWR, slave.station, 0x0800, pages)
            slave.rx = (slave.syncs[0].start, slave.syncs[0].length)
            slave.tx = (slave.syncs[1].start, slave.syncs[1].length)
        self.change(slave, PRE_OP)

    def configure(
        self,
        slave: Slave,
        *,
        target: int = OP,
        watchdog: tuple[int, int] = (2498, 1000),
        sync0: int = 0,
    ) -> None:
        """Configure INIT, PRE-OP, PDOs, watchdog, SyncManagers, FMMUs, clock, SAFE-OP, OP."""
        self.to_pre_op(slave)
        self.write_pdos(slave)
        self.ask_one(FPWR, slave.station, 0x0400, struct.pack("<H", watchdog[0]))
        self.ask_one(FPWR, slave.station, 0x0420, struct.pack("<H", watchdog[1]))
        parts = [p for d in self.domains for p in d.parts if p.slave is slave]
        self._configure_syncs(slave, {part.sync for part in parts})
        if slave.fmmu_count:
            pages = b"".join(part.page() for part in parts)
            pages = pages.ljust(16 * slave.fmmu_count, b"\0")
            self.ask_one(FPWR, slave.station, 0x0600, pages)
        if sync0:
            self._configure_clock(slave, sync0)
        for state in (SAFE_OP, OP):
            if state <= target:
                self.change(slave, state)

    def write_pdos(self, slave: Slave) -> None:
        """fsm_pdo.c, configuring: the assignment is cleared, filled and counted."""
        for number, pdos in slave.pdos.items():
            index = 0x1C10 + number
            self.download(slave, index, 0, b"\0")
            for rank, pdo in enumerate(pdos, 1):
                self.download(slave, index, rank, struct.pack("<H", pdo))
            self.download(slave, index, 0, bytes([len(pdos)]))

    def _configure_syncs(self, slave: Slave, used: set[int]) -> None:
        """ec_fsm_slave_config_enter_pdo_sync: all pages in one write."""
        first = 2 if slave.mailbox_protocols else 0
        if len(slave.syncs) <= first:
            return
        pages = [
            sync.page(slave.size(number), transfers=number in used)
            for number, sync in enumerate(slave.syncs)
            if number >= first
        ]
        self.ask_one(FPWR, slave.station, 0x0800 + 8 * first, b"".join(pages))

    def write_system_times(self) -> None:
        """fsm_master.c, ec_fsm_master_enter_write_system_times to _dc_write_offset."""
        for slave in self.slaves:
            if not slave.has_dc:
                continue
            block = self.ask_one(FPRD, slave.station, 0x0910, 24)
            system_time, old_offset = struct.unpack("<Q8xQ", block)
            system_time += TICK_NS  # time passes until the offset is written
            if slave.dc_64:
                offset = self.app_time - system_time + old_offset & (1 << 64) - 1
            else:
                offset = self.app_time - system_time + old_offset & (1 << 32) - 1
            self.ask_one(FPWR, slave.station, 0x0920, struct.pack("<QI", offset, slave.delay))

    def difference(self, slave: Slave) -> int:
        """Return 0x092C without its sign [ns]."""
        data = self.ask_one(FPRD, slave.station, 0x092C, 4)
        return int.from_bytes(data, "little") & 0x7FFFFFFF

    def _configure_clock(self, slave: Slave, sync0: int) -> None:
        """ec_fsm_slave_config_enter_dc_cycle to _dc_assign."""
        self.ask_one(FPWR, slave.station, 0x09A0, struct.pack("<II", sync0, 0))
        for _ in range(5000):  # EC_DC_SYNC_WAIT_MS
            if self.difference(slave) <= 10_000:  # EC_DC_MAX_SYNC_DIFF_NS
                break
        else:
            raise Complaint("slave did not sync after 5000 ms")
        start = self.app_time + 100_000_000
        self.ask_one(FPWR, slave.station, 0x0990, struct.pack("<Q", start - start % sync0 + sync0))
        self.ask_one(FPWR, slave.station, 0x0980, struct.pack("<H", 0x0300))

    # -- mailbox (mailbox.c, fsm_coe.c)

    def post(self, slave: Slave, payload: bytes) -> None:
        """ec_slave_mbox_prepare_send: the whole mailbox, counter 0, repeated for 3 s."""
        at, size = slave.rx
        demand(6 + len(payload) <= size, "data size does not fit in mailbox")
        message = struct.pack("<HHBB", len(payload), slave.station, 0, COE) + payload
        for _ in range(3000):
            answer = self.ask(FPWR, slave.station, at, message.ljust(size, b"\0"))
            if answer.counter == 1:
                return
            demand(answer.counter == 0, "more than one took a mailbox message")
        raise Complaint("reception of CoE request failed: working counter 0")

    def fetch(self, slave: Slave) -> bytes:
        """ec_slave_mbox_prepare_check, _check, _prepare_fetch, _fetch; emergencies are skipped."""
        for _ in range(RESPONSE_MS):
            if not self.ask_one(FPRD, slave.station, 0x0808, 8)[5] & 8:
                continue
            data = self.ask_one(FPRD, slave.station, *slave.tx)
            size, protocol = int.from_bytes(data[:2], "little"), data[5] & 0x0F
            demand(size + 6 <= slave.tx[1], "corrupt mailbox response")
            demand(protocol == COE, f"mailbox protocol {protocol} as response")
            payload = data[6 : 6 + size]
            if payload[1] >> 4 != 1:  # ec_fsm_coe_check_emergency
                return payload
        raise Complaint("timeout while waiting for a CoE response")

    def _initiated(self, slave: Slave, kind: int, index: int, subindex: int) -> bytes:
        """Return the response to an initiate request, and skip late answers to others."""
        while True:
            payload = self.fetch(slave)
            demand(len(payload) >= 6, "corrupted response")
            service, command, i, s = struct.unpack_from("<HBHB", payload)
            if service >> 12 == 2 and command >> 5 == 4:
                raise Abort(int.from_bytes(payload[6:10], "little"))
            if (service >> 12, command >> 5, i, s) == (3, kind, index, subindex):
                return payload

    def upload(self, slave: Slave, index: int, subindex: int) -> bytes:
        """ec_fsm_coe_up_start to _up_seg_response."""
        self.post(slave, struct.pack("<HBHB4x", 0x2000, 0x40, index, subindex))
        payload = self._initiated(slave, 2, index, subindex)
        command = payload[2]
        if command & 2:
            demand(len(payload) >= 10, "corrupted expedited response")
            return payload[6 : 10 - (command >> 2 & 3 if command & 1 else 0)]
        demand(len(payload) >= 10, "corrupted response")
        complete, data = int.from_bytes(payload[6:10], "little"), payload[10:]
        demand(bool(complete), "no complete size supplied")
        toggle = 0
        while len(data) < complete:
            data += self._segment(slave, toggle, room=complete - len(data))
            toggle ^= 0x10
        return data[:complete]

    def _segment(self, slave: Slave, toggle: int, *, room: int) -> bytes:
        self.post(slave, struct.pack("<HB7x", 0x2000, 0x60 | toggle))
        payload = self.fetch(slave)
        demand(len(payload) >= 10, "corrupted segment")
        demand(payload[1] >> 4 == 3 and payload[2] >> 5 == 0, "invalid segment response")
        demand(payload[2] & 0x10 == toggle, "toggle bit of a segment")
        part = payload[3:]
        if len(payload) == 10:
            part = part[: 7 - (payload[2] >> 1 & 7)]
        demand(len(part) <= room, "upload segment exceeds the complete size")
        demand(bool(payload[2] & 1) == (len(part) == room), "last segment")
        return part

    def download(self, slave: Slave, index: int, subindex: int, data: bytes) -> None:
        """ec_fsm_coe_prepare_down_start to _down_seg_response."""
        if 0 < len(data) <= 4:
            head = struct.pack("<HBHB", 0x2000, 0x23 | 4 - len(data) << 2, index, subindex)
            self.post(slave, head + data.ljust(4, b"\0"))
            self._initiated(slave, 3, index, subindex)
            return
        room = slave.rx[1] - 6 - 10
        head = struct.pack("<HBHBI", 0x2000, 0x21, index, subindex, len(data))
        self.post(slave, head + data[:room])
        self._initiated(slave, 3, index, subindex)
        offset, toggle = min(room, len(data)), 0
        while offset < len(data):
            part = data[offset : offset + slave.rx[1] - 6 - 3]
            offset += len(part)
            last = offset == len(data)
            unused = max(7 - len(part), 0)
            command = last | unused << 1 | toggle
            self.post(slave, struct.pack("<HB", 0x2000, command) + part.ljust(7, b"\0"))
            payload = self.fetch(slave)
            demand(payload[1] >> 4 == 3 and payload[2] >> 5 == 1, "invalid segment response")
            demand(payload[2] & 0x10 == toggle, "toggle bit of a segment response")
            toggle ^= 0x10

    def dictionary(self, slave: Slave) -> dict[int, dict[int, tuple[int, int, str]]]:
        """ec_fsm_coe_dict_*: objects with their entries (bits, access, name)."""
        self.post(slave, struct.pack("<HBBHH", 0x8000, 1, 0, 0, 1))
        indices: list[int] = []
        first, left = True, True
        while left:
            payload = self._information(slave, 2)
            skip = 8 if first else 6
            demand(len(payload) >= skip and len(payload) % 2 == 0, "invalid data size of list")
            indices += [i for (i,) in struct.iter_unpack("<H", payload[skip:])]
            first, left = False, bool(payload[2] & 0x80 or payload[4] or payload[5])
        return {index: self._describe(slave, index) for index in indices}

    def _describe(self, slave: Slave, index: int) -> dict[int, tuple[int, int, str]]:
        self.post(slave, struct.pack("<HBBHH", 0x8000, 3, 0, 0, index))
        payload = self._information(slave, 4)
        demand(len(payload) >= 12 and payload[6:8] == index.to_bytes(2, "little"), "description")
        demand(not payload[2] & 0x80, "fragment follows (not implemented)")
        entries = {}
        for subindex in range(payload[10] + 1):
            request = struct.pack("<HBBHHBB", 0x8000, 5, 0, 0, index, subindex, 1)
            self.post(slave, request)
            try:
                entry = self._information(slave, 6)
            except Abort:
                continue  # a warning only
            demand(len(entry) >= 16, "invalid data length of an entry description")
            demand(struct.unpack_from("<HB", entry, 6) == (index, subindex), "another entry")
            bits, access = struct.unpack_from("<HH", entry, 12)
            entries[subindex] = (bits, access, entry[16:].decode("latin-1"))
        return entries

    def _information(self, slave: Slave, opcode: int) -> bytes:
        payload = self.fetch(slave)
        demand(len(payload) >= 6 and payload[1] >> 4 == 8, "no SDO information")
        if payload[2] & 0x7F == 7:
            raise Abort(int.from_bytes(payload[6:10], "little"))
        demand(payload[2] & 0x7F == opcode, "invalid SDO information response")
        return payload
