"""Compiled segment: controllers, clock, and access from the application side.

The headers contain the frame path, with one file for each mechanism. The frame path does not need
the GIL. `_buffers.pyx` gives the application access to SyncManagers, and `_motors.pyx` to motors.
"""

from cpython.bytes cimport PyBytes_FromStringAndSize
from cpython.pycapsule cimport PyCapsule_GetPointer, PyCapsule_IsValid
from cpython.exc cimport PyErr_SetInterrupt
from libc.errno cimport EINTR, EIO
from libc.math cimport M_PI as pi
from libc.stdint cimport int64_t, uint8_t, uint16_t, uint32_t
from libc.string cimport memcpy

cdef extern from "link.h":
    uint32_t CAT_FRAME_MAX

cdef extern from "packet_loop.h" nogil:
    int packet_loop(cat_segment *s, int fd, int second_fd, int stop_fd, int64_t max_age)

cdef extern from "segment_memory.h":
    cpdef enum:
        SLOT_CONTROLWORD, SLOT_STATUSWORD, SLOT_MODE
        SLOT_MODE_DISPLAY, SLOT_TARGET_POSITION, SLOT_TARGET_VELOCITY
        SLOT_TARGET_TORQUE, SLOT_POSITION_OFFSET, SLOT_VELOCITY_OFFSET
        SLOT_TORQUE_OFFSET, SLOT_POSITION_DEMAND, SLOT_POSITION
        SLOT_VELOCITY, SLOT_TORQUE_DEMAND, SLOT_TORQUE
        SLOT_FOLLOWING_ERROR, SLOT_ERROR_CODE, SLOT_DIGITAL_INPUTS
        SLOT_DIGITAL_OUTPUTS, SLOT_QUICK_STOP_OPTION, SLOT_SHUTDOWN_OPTION
        SLOT_DISABLE_OPTION, SLOT_FAULT_OPTION, SLOT_FOLLOWING_WINDOW
        SLOT_FOLLOWING_TIME, SLOT_LIMIT_MIN, SLOT_LIMIT_MAX
        SLOT_MAX_TORQUE, SLOT_MAX_SPEED, SLOT_QUICK_STOP_DECELERATION
        SLOT_DECELERATION, SLOT_INTERPOLATION_PERIOD, SLOT_INTERPOLATION_EXPONENT
        SLOT_VELOCITY_DEMAND, SLOT_POLARITY
        SLOT_HOME_OFFSET, SLOT_HOMING_METHOD, SLOT_HOMING_SPEED
        SLOT_HOMING_SLOW, SLOT_HOMING_ACCELERATION, SLOT_HOMING_TORQUE
        SLOT_ABORT_CONNECTION_OPTION
        SLOT_PROFILE_VELOCITY, SLOT_ACCELERATION, SLOT_HALT_OPTION, SLOT_POSITION_WINDOW
        SLOT_POSITION_WINDOW_TIME, SLOT_VELOCITY_WINDOW, SLOT_VELOCITY_WINDOW_TIME
        SLOT_VELOCITY_THRESHOLD
        SLOT_PROBE_FUNCTION, SLOT_PROBE_STATUS, SLOT_PROBE_SOURCE_1, SLOT_PROBE_SOURCE_2
        SLOT_PROBE_POSITIONS, SLOT_PROBE_TIMES, SLOT_PROBE_COUNTERS
    cpdef enum:
        EVENT_AL_CONTROL, EVENT_MAILBOX_WRITTEN, EVENT_MAILBOX_READ
        EVENT_REPEAT_REQUEST, EVENT_WATCHDOG, EVENT_OUTPUTS
        EVENT_EMERGENCY, EVENT_SYNC_SEEN, EVENT_SYNC_MISSED, EVENT_SYNC_LOST
        EVENT_RESET

FOREVER = NEVER
SLOTS_PER_AXIS = AXIS_SLOTS
AXES_MAX = MAX_AXES
MAPPED_MAX = MAX_MAPPED


cdef int _serve_application(void *owner) noexcept with gil:
    return (<Core>owner)._run_service()


cdef class Core:
    """Owner of the memory of all controllers. `position`: position of a device, from 0.

    Methods raise IndexError if the device does not exist.
    """

    def __cinit__(self, int count, bint is_virtual, *, bint ring=False, int64_t detection_ns=0):
        if not 0 <= count <= 65535:
            raise ValueError(f"a segment can have 0 to 65535 devices, not {count}")
        self._segment = segment_make(count, is_virtual, ring, detection_ns)
        if self._segment == NULL:
            raise MemoryError("cannot allocate memory for the segment")
        self.count = count
        self._segment.owner = <void *>self
        self._segment.service = _serve_application

    def __dealloc__(self):
        segment_free(self._segment)

    cdef controller *_at(self, int position) except NULL:
        if not 0 <= position < self.count:
            raise IndexError(f"no device at position {position}; the segment has {self.count} devices")
        return &self._segment.controllers[position]

    cdef sync_manager *_sync_manager_at(self, int position, int n) except NULL:
        cdef controller *c = self._at(position)
        if not 0 <= n < c.sm_count:
            raise IndexError(f"the device at position {position} has no SyncManager {n}")
        return &c.sm[n]

    cdef servo_axis *_axis(self, int position, int axis) except NULL:
        cdef controller *c = self._at(position)
        if not 0 <= axis < c.axis_count:
            raise IndexError(f"the device at position {position} has no axis {axis}")
        return &c.axes[axis]

    # -- construction ---------------------------------------------------------------------------

    def make_controller(self, int position, *, int ram, bytes sii, int slots, int axes, int fmmus,
                        int sync_managers, int clock_bits, bint lrw, int identification, ports):
        """Create a controller without power.

        Args:
            position: Position of the device.
            ram: Size of the process RAM [bytes].
            sii: Content of the EEPROM.
            slots: Number of slots.
            axes: Number of servo axes.
            fmmus: Number of FMMUs.
            sync_managers: Number of SyncManagers.
            clock_bits: Width of the clock: 0 (none), 32 or 64.
            lrw: True if the device supports LRW.
            identification: Explicit device ID; 0: none.
            ports: Numbers of the ports.

        Raises:
            ValueError: The position already has a controller, or a value is out of range.
            MemoryError: Out of memory.
        """
        cdef controller *c = self._at(position)
        cdef int made
        if c.memory != NULL:
            raise ValueError(f"position {position} already has a controller")
        if not (0 < ram <= 61440 and 0 <= axes <= 8 and 0 <= slots <= 65535 and len(sii) % 2 == 0
                and clock_bits in (0, 32, 64) and 0 < fmmus <= 8 and 0 < sync_managers <= 8
                and slots >= axes * AXIS_SLOTS and all(0 <= p < PORTS for p in ports)):
            raise ValueError(f"invalid parameters of the controller at position {position}")
        lock(self._segment)
        made = controller_make(c, ram, len(sii) // 2, slots, axes)
        unlock(self._segment)
        if not made:
            raise MemoryError(f"cannot allocate memory for the controller at position {position}")
        for p in range(PORTS):
            c.ports[<int>p].exists = p in ports
        c.fmmu_count, c.sm_count, c.has_dc, c.no_lrw = fmmus, sync_managers, clock_bits, not lrw
        c.identification = identification
        memcpy(c.sii.image, <const char *>sii, len(sii))

    def remove_controller(self, int position):
        """Remove a device and disconnect its motors. Its position and its cables remain."""
        cdef controller *c = self._at(position)
        lock(self._segment)
        controller_remove(c)
        segment_light(self._segment, False)
        unlock(self._segment)

    def exchange_controllers(self, int one, int other):
        """Exchange two devices with their complete state. A no-op if one of them has power."""
        cdef controller *a = self._at(one)
        cdef controller *b = self._at(other)
        lock(self._segment)
        if a != b and not a.powered and not b.powered:
            controllers_exchange(a, b)
        unlock(self._segment)

    def switch_power(self, int position, bint on):
        """Switch the power of a device on or off.

        Without power, the device loses all data except its EEPROM, crystal, shaft positions, loads
        and STO inputs. Its neighbours lose light.

        Raises:
            ValueError: The position has no controller.
        """
        cdef controller *c = self._at(position)
        if c.memory == NULL:
            raise ValueError(f"position {position} has no controller")
        lock(self._segment)
        if on:
            controller_power_on(c)
        else:
            controller_power_off(c)
        segment_light(self._segment, False)
        unlock(self._segment)

    def powered(self, int position):
        return bool(self._at(position).powered)

    def ports(self, int position):
        """Return the port numbers of a device."""
        cdef controller *c = self._at(position)
        return tuple([p for p in range(PORTS) if c.ports[<int>p].exists])

    def mute(self, int position, bint muted):
        """Make a device ignore logical datagrams, or process them again."""
        self._at(position).mute = muted

    # -- time and service -----------------------------------------------------------------------

    @property
    def now(self) -> int:
        """Present time [ns]. For the service in virtual time, it is the time of its work.

        A shared clock can be ahead of a segment.
        """
        return self._segment.now if self._serving else line_now(&self._segment.ends[0])

    @property
    def epoch(self) -> int:
        """Start time of the fault clock [ns]; -1 in real time before the first frame."""
        return self._segment.epoch

    @property
    def is_virtual(self) -> bool:
        return bool(self._segment.is_virtual)

    def use_clock(self, clock):
        """Use the virtual time of a shared clock, `clock.capsule` (native/clock.h).

        Raises:
            ValueError: The capsule is not that of a virtual clock, or has another version.
        """
        cdef const cat_clock *table
        capsule = clock.capsule
        if not PyCapsule_IsValid(capsule, CAT_CLOCK_CAPSULE):
            raise ValueError("clock.capsule is not a capsule of a clock")
        table = <const cat_clock *>PyCapsule_GetPointer(capsule, CAT_CLOCK_CAPSULE)
        if table.version != CAT_CLOCK_VERSION or not table.flags & CAT_CLOCK_VIRTUAL:
            raise ValueError("the clock is not virtual, or its table has another version")
        self._clock = clock, capsule       # keeps the owner of the table alive
        self._segment.clock = table
        self._segment.now = self._segment.epoch = table.now(table.self)

    @property
    def shares_clock(self) -> bool:
        """True if the time of the segment is that of a shared clock."""
        return self._segment.clock != NULL

    def use_service(self, service):
        """Set the service: a function that runs the applications and returns its next due time [ns]."""
        self._service = service

    def wake_at(self, int64_t when):
        if when < self._segment.service_due:
            self._segment.service_due = when

    def wake_by(self, int event_fd):
        self._segment.event_fd = event_fd

    cdef int _run_service(self) noexcept:
        self._segment.service_due = NEVER
        self._serving = True
        try:
            self._segment.service_due = self._service()
            return 0
        except KeyboardInterrupt:          # before or after the service ran: pass it to the caller
            self._segment.service_due = self._segment.now
            PyErr_SetInterrupt()
            return -EINTR
        except BaseException as failure:
            self.failure = failure
            return -EIO
        finally:
            self._serving = False

    def raise_failure(self):
        """Raise and clear the exception that the service has raised, if any."""
        for core in (self, *(self._partners or ())):
            failure = core.take_failure()
            if failure is not None:
                raise failure

    def take_failure(self):
        """Return and clear the exception that the service has raised; None if there is none."""
        failure, self.failure = self.failure, None
        self._segment.failed = 0
        return failure

    def advance(self):
        """Execute the due compiled work of the segment. A no-op in virtual time."""
        if not self._segment.is_virtual:
            with nogil:
                lock(self._segment)
                segment_advance(self._segment, monotonic_now())
                unlock(self._segment)

    def take_events(self):
        """Return the pending events as [(position, events)], and clear them."""
        cdef int k
        cdef uint32_t events
        taken = []
        if not self._segment.pending:
            return taken
        self._segment.pending = 0          # first, because a new event sets it again
        for k in range(self.count):
            if self._segment.controllers[k].events:
                lock(self._segment)
                events = self._segment.controllers[k].events
                self._segment.controllers[k].events = 0
                unlock(self._segment)
                taken.append((k, events))
        return taken

    # -- the PDI side ---------------------------------------------------------------------------

    def peek(self, int position, int address, int size):
        """Return bytes of a controller's memory, without the side effects of a read by a frame.

        New inputs of the models are first written into the buffers.

        Args:
            position: Position of the device.
            address: First address.
            size: Number of bytes.

        Raises:
            ValueError: The range is outside of the memory.
        """
        cdef controller *c = self._at(position)
        if address < 0 or size < 0 or address + size > <int64_t>c.memory_size:
            raise ValueError(f"{size} bytes at 0x{address:04X} are outside of the memory")
        lock(self._segment)
        inputs_flush(self._segment)
        unlock(self._segment)
        return PyBytes_FromStringAndSize(<char *>c.memory + address, size)

    def poke(self, int position, int address, bytes data):
        """Write bytes into a controller's memory without checks, for error counters and faults.

        Args:
            position: Position of the device.
            address: First address.
            data: Bytes to write.

        Raises:
            ValueError: The range is outside of the memory.
        """
        cdef controller *c = self._at(position)
        if address < 0 or address + len(data) > <int64_t>c.memory_size:
            raise ValueError(f"{len(data)} bytes at 0x{address:04X} are outside of the memory")
        lock(self._segment)
        memcpy(c.memory + address, <const char *>data, len(data))
        unlock(self._segment)

    def fetch_al_control(self, int position):
        """Return AL control, and unlock the register for the next request."""
        cdef controller *c = self._at(position)
        lock(self._segment)
        c.al_unread = 0
        value = register_number(c, REG_AL_CONTROL, 2)
        unlock(self._segment)
        return value

    def show_al_status(self, int position, int status, int code):
        cdef controller *c = self._at(position)
        lock(self._segment)
        al_show(c, status, code)
        unlock(self._segment)

    def outputs_valid(self, int position):
        return bool(self._at(position).outputs_valid)

    def enable_outputs(self, int position, bint valid):
        self._at(position).outputs_valid = valid

    def expect_outputs(self, int position):
        """Arm EVENT_OUTPUTS for the next complete process data."""
        self._at(position).outputs_seen = 0

    def outputs_seen(self, int position):
        return bool(self._at(position).outputs_seen)

    def outputs_at(self, int position):
        """Return the segment time of the last output update [ns]; `FOREVER` before the first."""
        cdef controller *c = self._at(position)
        cdef int64_t when
        lock(self._segment)
        when = c.outputs_ns
        unlock(self._segment)
        return when

    def output_image(self, int position, int n):
        """Return the last complete outputs without side effects; empty if there are none."""
        cdef controller *c = self._at(position)
        cdef sync_manager *sm = self._sync_manager_at(position, n)
        if not (sm.enabled and sm.written) or sm.mailbox:
            return b""
        return PyBytes_FromStringAndSize(<char *>sm_buffer(c, sm, sm.latest), sm.length)

    # -- process data and models ----------------------------------------------------------------

    def map_process_data(self, int position, bint outputs, int n, list entries):
        """Set the mapping of one direction.

        Args:
            position: Position of the device.
            outputs: True for outputs, False for inputs.
            n: Number of the SyncManager; -1: nothing is mapped.
            entries: Mapped slots, as (bit, bits, slot, is_signed).

        Raises:
            ValueError: The SyncManager or an entry is out of range.
        """
        cdef controller *c = self._at(position)
        cdef mapping *m = &c.outputs if outputs else &c.inputs
        cdef int k = 0
        if len(entries) > MAX_MAPPED or not -1 <= n < c.sm_count:
            raise ValueError(f"invalid mapping: {len(entries)} entries in SyncManager {n}")
        for bit, bits, slot, is_signed in entries:
            if not (0 < bits <= 64 and 0 <= slot < c.slot_count and 0 <= bit <= 65536):
                raise ValueError(f"invalid mapping entry: {bits} bits at bit {bit}, slot {slot}")
        lock(self._segment)
        m.sm = n
        m.count = len(entries)
        for bit, bits, slot, is_signed in entries:
            m.entries[k].bit = bit
            m.entries[k].bits = bits
            m.entries[k].slot = slot
            m.entries[k].is_signed = is_signed
            k += 1
        unlock(self._segment)

    def refresh_inputs(self, int position):
        cdef controller *c = self._at(position)  # raises before the lock is taken
        lock(self._segment)
        inputs_put(c)
        unlock(self._segment)

    def run_model(self, int position, int64_t period_ns):
        """Step the model of a device every `period_ns` from now on, independent of SYNC pulses.

        Raises:
            ValueError: The period is shorter than 1 us.
        """
        cdef controller *c = self._at(position)
        if period_ns < 1000:
            raise ValueError(f"a device cycle of {period_ns} ns is shorter than 1 us")
        lock(self._segment)
        synchronous_end(c)
        model_period(c, period_ns)
        unlock(self._segment)

    def ignore_loop_control(self, int position):
        """Let the ports of a device follow their links, regardless of DL control."""
        self._at(position).fixed_loops = 1

    def run_model_by_pulses(self, int position, int signal, int64_t cycle_ns,
                            int64_t longest_step_ns):
        """Step the model of a device at SYNC pulses, and at equal intervals between them.

        Args:
            position: Position of the device.
            signal: Bit of the pulses in 0x0981.
            cycle_ns: Period of the pulses [ns].
            longest_step_ns: Maximum interval between steps [ns].

        Raises:
            ValueError: A time is out of range.
        """
        cdef controller *c = self._at(position)
        cdef int64_t steps
        if not 1000 <= cycle_ns < 1 << 32 or longest_step_ns < 1000:
            raise ValueError(f"cycle_ns must be 1000 to 2^32 - 1, not {cycle_ns}, and longest_step_ns at"
                             f" least 1000, not {longest_step_ns}")
        steps = (cycle_ns + longest_step_ns - 1) // longest_step_ns
        lock(self._segment)
        synchronous_begin(c, cycle_ns, steps, <uint8_t>signal)
        model_period(c, cycle_ns // steps)
        unlock(self._segment)

    def tune_synchronous(self, int position, *, int64_t minimum_ns, int64_t copy_ns, int limit):
        """Set the parameters of the synchronous mode.

        Args:
            position: Position of the device.
            minimum_ns: Shortest SYNC0 cycle [ns].
            copy_ns: Minimum time from the arrival of outputs to the pulse [ns].
            limit: Number of consecutive pulses without new outputs that is an error.

        Raises:
            ValueError: A value is out of range.
        """
        cdef controller *c = self._at(position)
        if not (0 <= minimum_ns and 0 <= copy_ns and 1 <= limit <= 0xFFFF):
            raise ValueError(f"invalid synchronisation at position {position}: minimum_ns={minimum_ns},"
                             f" copy_ns={copy_ns}, limit={limit}")
        c.synchronous.minimum, c.synchronous.copy_time = minimum_ns, copy_ns
        c.synchronous.limit = limit

    def synchronous(self, int position):
        """Return the state and counters of the synchronous mode.

        The values are: synchronised to pulses, pulses seen, missed, exceeded, shift too short,
        error.
        """
        cdef synchronous_cycle *d = &self._at(position).synchronous
        return bool(d.active), bool(d.seen), d.missed, d.exceeded, d.shift_short, bool(d.error)

    def system_time(self, int position):
        """Return the exact time of a device's clock [ns], without the scatter that frames read."""
        cdef int64_t time
        cdef controller *c = self._at(position)  # raises before the lock is taken
        lock(self._segment)
        time = dc_system_time(c, self._segment.now)
        unlock(self._segment)
        return time

    def latch_input(self, int position, int number, bint level):
        """Set the level of a latch input of a device's clock now.

        Raises:
            IndexError: The device or the input does not exist.
        """
        cdef controller *c = self._at(position)
        if not 0 <= number < LATCH_INPUTS:
            raise IndexError(f"latch input must be 0 or 1, not {number}")
        lock(self._segment)
        latch_input(c, number, level, self._segment.now)
        unlock(self._segment)

    def pulses(self, int position):
        """Return the numbers of SYNC0 and SYNC1 pulses since the controller was created."""
        cdef controller *c = self._at(position)
        return c.sync.pulses0, c.sync.pulses1

    def slot(self, int position, int number):
        cdef controller *c = self._at(position)
        if not 0 <= number < c.slot_count:
            raise IndexError(f"the device at position {position} has no slot {number}")
        lock(self._segment)
        slots_refresh(c)
        unlock(self._segment)
        return c.slots[number]

    def put_slot(self, int position, int number, int64_t value):
        cdef controller *c = self._at(position)
        if not 0 <= number < c.slot_count:
            raise IndexError(f"the device at position {position} has no slot {number}")
        c.slots[number] = value

    def emergency(self, int position):
        return self._at(position).emergency

    def freeze(self, int position, bint frozen):
        self._at(position).frozen = frozen

    def tune_crystal(self, int position, double error, double swing, double period_s, double scatter_ns):
        """Set the errors of a device's crystal.

        Args:
            position: Position of the device.
            error: Relative frequency error.
            swing: Amplitude of the slow change of the frequency, relative.
            period_s: Period of this change [s].
            scatter_ns: Width of the scatter of time stamps [ns].
        """
        cdef controller *c = self._at(position)
        cdef double turn = 2e-9 * pi / period_s if swing != 0 else 0
        lock(self._segment)
        dc_tune(c, error, swing, turn, scatter_ns, self._segment.now)
        sync_schedule(c)
        unlock(self._segment)

    def time_sii(self, int position, int64_t read_ns, int64_t write_ns, bint read_eight):
        cdef controller *c = self._at(position)
        c.sii.read_time, c.sii.write_time = read_ns, write_ns
        c.memory[0x0502] = (c.memory[0x0502] & 0xBF) | (0x40 if read_eight else 0)

    def sii_image(self, int position):
        cdef controller *c = self._at(position)
        return PyBytes_FromStringAndSize(<char *>c.sii.image, 2 * c.sii.words)

    # -- frames ---------------------------------------------------------------------------------

    @property
    def counters(self):
        cdef frame_counters f = self._segment.counters
        return f.frames, f.datagrams, f.malformed, f.foreign, f.lost, f.expired

    def pass_frame(self, bytes frame):
        """Process one frame without delay and return it; None if it is lost or not EtherCAT.

        Raises:
            ValueError: The frame is too long.
        """
        cdef uint8_t buffer[2048]
        cdef int exit = -LOSS_NO_LIGHT
        cdef int size = len(frame)
        if size > <int>CAT_FRAME_MAX:
            raise ValueError(f"a frame can have at most {CAT_FRAME_MAX} bytes, not {size}")
        memcpy(buffer, <const char *>frame, size)
        lock(self._segment)
        routes_refresh(self._segment)
        self._segment.passage = self._segment.now
        if frame_is_ours(buffer, size):
            exit = frame_through(self._segment, &self._segment.routes[0], &NO_FATE, buffer, size)
        else:
            self._segment.counters.foreign += 1
        unlock(self._segment)
        return PyBytes_FromStringAndSize(<char *>buffer, size) if exit >= 0 else None

    def answer_packets(self, int fd, int second_fd, int stop_fd, int64_t max_age_ns):
        """Run the packet loop on AF_PACKET sockets until `stop_fd` is readable.

        Args:
            fd: Socket of the first end.
            second_fd: Socket of the second end of a ring; -1: none.
            stop_fd: Descriptor that ends the loop when it is readable.
            max_age_ns: Maximum time that a frame may wait in its socket [ns].

        Returns:
            0 or -errno.
        """
        cdef int result
        with nogil:
            result = packet_loop(self._segment, fd, second_fd, stop_fd, max_age_ns)
        return result
