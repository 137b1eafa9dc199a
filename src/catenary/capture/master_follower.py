"""One master of a capture: its devices, its broadcasts, its frames."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.capture.clocks import ReferenceClock
from catenary.capture.contents import AddressAssigned, DeviceCount, FramesLost, StateRequest
from catenary.capture.cycles import Cycles
from catenary.capture.device_follower import DeviceFollower
from catenary.capture.events import UNKNOWN_STEP, Event, Master, Step, common_step
from catenary.capture.master_names import master_name
from catenary.capture.pairing import FramePair
from catenary.capture.register_writes import is_configuration, register_writes
from catenary.capture.registers import WrittenRegisters
from catenary.capture.states import Found, StateFollower, decode_control
from catenary.capture.transaction import Transaction, transactions
from catenary.errors import DecodeError
from catenary.wire.al import AlState, AlStatus
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import AL_CONTROL, AL_STATUS, STATION_ADDRESS

MAXIMUM_DEVICES = 0xFFFF
_ORDER = (AlState.BOOT, AlState.INIT, AlState.PRE_OP, AlState.SAFE_OP, AlState.OP)


class MasterFollower:
    """Owner of everything that is known about one master and its devices."""

    def __init__(self, number: int, first: FramePair) -> None:
        frame = first.sent or first.answer
        assert frame is not None
        self.number = number
        self.devices: list[DeviceFollower] = []
        self.cycles = Cycles()
        self.reference = ReferenceClock()
        self._source = first.source
        self._name = master_name(frame.frame)
        self._started_ns = self._ended_ns = frame.time_ns
        self._sent = self._returned = self._lost = 0
        self._lost_run: tuple[int, int, int] | None = None  # count, time and packet of the first
        self._by_position: dict[int, DeviceFollower] = {}
        self._by_station: dict[int, DeviceFollower] = {}
        self._broadcast = WrittenRegisters()
        self._initial = StateFollower()  # of new devices, from broadcasts
        self._device_count: int | None = None

    def follow(self, pair: FramePair) -> Iterator[Event]:
        """Yield the events of a frame."""
        base = pair.answer or pair.sent
        assert base is not None
        self._sent += pair.sent is not None
        self._returned += pair.answer is not None
        self._ended_ns = max(self._ended_ns, base.time_ns)
        if pair.answer is not None:
            yield from self.end_of_loss()
        elif not pair.under_way or not self._returned:
            self._note_lost(base.time_ns, base.number)
        if pair.answer is not None or not self._returned:  # only sent frames may be captured
            for each in transactions(pair, self._device_count):
                for device, found in self._follow(each):
                    yield self._event(each.time_ns, each.packet, device, found)
        for content in self.cycles.follow(pair):
            yield self._event(base.time_ns, base.number, None, Found(self._step(), content))

    def flush(self, packet: int) -> Iterator[Event]:
        """Yield the events at the end of the capture: lost frames, missing answers.

        Args:
            packet: Number of the last packet.
        """
        if self._returned:
            yield from self.end_of_loss()
        for device in self.devices:
            for found in device.flush():
                yield self._event(self._ended_ns, packet, device, found)

    def end_of_loss(self) -> Iterator[Event]:
        """Yield the frames that were lost in a row."""
        if self._lost_run is not None:
            count, time_ns, packet = self._lost_run
            self._lost_run = None
            yield self._event(time_ns, packet, None, Found(UNKNOWN_STEP, FramesLost(count)))

    def snapshot(self) -> Master:
        """Return the source address, the name and the numbers of frames."""
        return Master(
            *(self.number, self._source, self._name, self._sent, self._returned, self._lost),
            *(self._started_ns, self._ended_ns),
        )

    def _note_lost(self, time_ns: int, packet: int) -> None:
        self._lost += 1
        count, first_ns, first_packet = self._lost_run or (0, time_ns, packet)
        self._lost_run = count + 1, first_ns, first_packet

    def _event(
        self, time_ns: int, packet: int, device: DeviceFollower | None, found: Found
    ) -> Event:
        number = None if device is None else device.number
        return Event(time_ns, packet, self.number, number, found.step, found.content)

    def _follow(self, each: Transaction) -> Iterator[tuple[DeviceFollower | None, Found]]:
        self.reference.follow(each)
        if each.is_broadcast:
            for found in self._follow_broadcast(each):
                yield None, found
            return
        if each.by_position and (address := each.was_written(STATION_ADDRESS)) is not None:
            yield from self._assign(each, int.from_bytes(address, "little"))
        device = self._device(each)
        if device is None:
            return
        for found in device.follow(each):
            if isinstance(found.content, StateRequest):
                self._note_request(found.step.before, found.content.state)
            yield device, found

    def _assign(
        self, each: Transaction, station: int
    ) -> Iterator[tuple[DeviceFollower | None, Found]]:
        if not each.accepted or not station:
            return
        device = self._by_position.get(each.position)
        if device is None:
            device = self._add(each.position, station)
            if device is None:
                return
        device.station = station
        self._by_station[station] = device
        yield device, Found(device.states.step(), AddressAssigned(each.position, station))

    def _device(self, each: Transaction) -> DeviceFollower | None:
        """Return the addressed device; None if no device answered and the address is new."""
        if each.by_position:
            found = self._by_position.get(each.position)
        else:
            found = self._by_station.get(each.adp)
        if found is not None or not each.accepted:
            return found
        if each.by_position:
            return self._add(each.position, None)
        return self._add(None, each.adp)

    def _add(self, position: int | None, station: int | None) -> DeviceFollower | None:
        if len(self.devices) >= MAXIMUM_DEVICES:
            return None
        device = DeviceFollower(len(self.devices), position, station)
        device.states.inherit(self._initial)
        self.devices.append(device)
        if position is not None:
            self._by_position[position] = device
        if station is not None:
            self._by_station[station] = device
        return device

    def _follow_broadcast(self, each: Transaction) -> Iterator[Found]:
        if each.written is not None:
            yield from self._broadcast_write(each, each.written)
        if each.command is EcatCommand.BRD and each.working_counter:
            if each.ado in (0, AL_STATUS.address) and each.working_counter != self._device_count:
                before, self._device_count = self._device_count, each.working_counter
                yield Found(self._step(), DeviceCount(each.working_counter, before))
            if (status := each.was_read(AL_STATUS)) is not None:
                yield from self._broadcast_status(each, status)

    def _broadcast_write(self, each: Transaction, data: bytes) -> Iterator[Found]:
        control_data = each.was_written(AL_CONTROL)
        control = None if control_data is None else decode_control(control_data)
        if control is not None:
            content = StateRequest(control.state, control.acknowledge, each.accepted)
            before = self._step().before
            yield Found(Step(before, control.state), content)
            if each.accepted:
                for states in self._all_states():
                    states.set_requested(control, each.time_ns)
                self._note_request(before, control.state)
        for written in register_writes(self._broadcast, each.ado, data, accepted=each.accepted):
            yield Found(self._step(configures=is_configuration(written)), written)
        if each.accepted:
            for device in self.devices:
                device.store(each.ado, data)
            if each.was_written(STATION_ADDRESS) is not None:
                self._by_station.clear()

    def _broadcast_status(self, each: Transaction, data: bytes) -> Iterator[Found]:
        """Use a broadcast read only if all devices have the same state without an error."""
        try:
            status = AlStatus.from_word(int.from_bytes(data, "little"))
        except DecodeError:
            return  # several states
        if status.error or status.state is AlState.BOOT:  # BOOT is also INIT | PRE-OP
            return
        before = self._step().before
        first, *others = [
            states.set_state(status.state, each.time_ns) for states in self._all_states()
        ]
        changed = [content for content in others or [first] if content is not None]
        if changed:
            latest = min(changed, key=lambda content: content.after_ns or 0)
            yield Found(Step(before, status.state), latest)

    def _all_states(self) -> Iterator[StateFollower]:
        """Yield the states of all devices, and those that new devices begin with."""
        yield self._initial
        for device in self.devices:
            yield device.states

    def _step(self, *, configures: bool = False) -> Step:
        """Return the common step of all devices."""
        followers = [device.states for device in self.devices] or [self._initial]
        return common_step(states.step(configures=configures) for states in followers)

    def _note_request(self, before: AlState | None, requested: AlState) -> None:
        """Forget the working counters if devices leave a state downwards."""
        if before is None or _ORDER.index(requested) < _ORDER.index(before):
            self.cycles.forget_expectations()
