"""SERCOS drive, IEC 61800-7-204: SoE, telegrams as process data, and a motor.

The motor and its control loops are those of the CiA 402 servo. Positions are in increments
(S-0-0079 per turn), velocities in 0.0001 rpm, and torques in 0.1 % of the rated torque. The drive
has no CoE, like Beckhoff's AX5000.
"""

from __future__ import annotations

from catenary.virtual import _segment
from catenary.virtual.coe.quirks import NO_MAILBOX_QUIRKS, MailboxQuirks
from catenary.virtual.crystal import EXACT, ClockBits, Crystal
from catenary.virtual.description import Description
from catenary.virtual.devices.application import Application, mailbox_of, sync_managers_of
from catenary.virtual.devices.applied import MailboxOptions
from catenary.virtual.devices.motor import Motor
from catenary.virtual.devices.motor_device import MotorDevice
from catenary.virtual.sii_quirks import NO_SII_QUIRKS, SiiQuirks
from catenary.virtual.soe.drive import SLOTS, STATUS_SLOT, SercosAxis
from catenary.virtual.soe.parameter import idn
from catenary.virtual.soe.quirks import NO_SOE_QUIRKS, SoeQuirks

VELOCITY_PER_TURN_S = 600_000  # 60 rpm in 0.0001 rpm
STATUS_BITS = 14
STATUS_NAMES = ("NOT READY", "READY", "POWERED", "OPERATING")  # bits 14 and 15 of S-0-0135


class SercosDrive(MotorDevice):
    """Servo drive with the SERCOS profile, and its motor."""

    kind = "sercos_drive"

    def __init__(
        self,
        *,
        name: str = "Catenary virtual SERCOS drive",
        alias: int = 0,
        serial: int = 0,
        resolution: int = 1 << 20,
        inertia: float = 5e-4,
        rated_torque: float = 2.0,
        max_velocity: float = 350.0,
        mailbox_bytes: int = 128,
        mailbox_delay: float = 300e-6,
        crystal: Crystal = EXACT,
        clock_bits: ClockBits = 64,
        lrw: bool = True,
        soe_quirks: SoeQuirks = NO_SOE_QUIRKS,
        mailbox_quirks: MailboxQuirks = NO_MAILBOX_QUIRKS,
        sii_quirks: SiiQuirks = NO_SII_QUIRKS,
    ) -> None:
        """Initialise the drive.

        Args:
            name: Device name.
            alias: Station alias.
            serial: Serial number.
            resolution: Increments per turn (S-0-0079).
            inertia: Inertia of the motor [kg·m²].
            rated_torque: Rated torque [N·m].
            max_velocity: Maximum velocity [rad/s].
            mailbox_bytes: Size of each mailbox [bytes].
            mailbox_delay: Time until a request is answered [s].
            crystal: Frequency error and jitter of the clock.
            clock_bits: Width of the clock, 32 or 64.
            lrw: True if the device supports LRW.
            soe_quirks: Differences from the SERCOS profile.
            mailbox_quirks: Quirks of the mailbox.
            sii_quirks: Quirks of the SII.

        Raises:
            ValueError: A value is out of range.
        """
        motor = Motor(
            counts_per_turn=resolution,
            velocity_counts_per_turn=VELOCITY_PER_TURN_S,
            inertia=inertia,
            rated_torque=rated_torque,
            max_velocity=max_velocity,
        )
        self._sercos = self._axis(motor, soe_quirks)
        super().__init__(
            name=name,
            alias=alias,
            serial=serial,
            lrw=lrw,
            crystal=crystal,
            clock_bits=clock_bits,
            sii_quirks=sii_quirks,
            mailbox=MailboxOptions(
                mailbox_bytes, mailbox_delay, mailbox_quirks, None, [self._sercos]
            ),
        )
        self.install_motors([motor])

    def _axis(self, motor: Motor, quirks: SoeQuirks) -> SercosAxis:
        return SercosAxis(
            motor,
            quirks,
            get=lambda slot: self.core.slot(self.position, slot),
            put=lambda slot, value: self.core.put_slot(self.position, slot, value),
            motor_state=lambda: self._motors.state(self.position, 0)[3],
        )

    def description(self) -> Description:
        managers = sync_managers_of(self.mailbox_bytes, (), ())
        return Description(
            name=self.name,
            order="CVX001",
            group="SERCOS drives",
            product_code=0x0008_0001,
            serial=self.serial,
            alias=self.alias,
            emulation=False,
            pdi_type=0x05,
            mailbox=mailbox_of(self.mailbox_bytes, 0),
            sync_managers=managers,
            fmmus=(1, 2, 3),
            rx_pdos=(),
            tx_pdos=(),
            clock=True,
            slots=SLOTS,
            serves_coe=False,
            axes=1,
            lrw=self.lrw,
        )

    def add_objects(self, application: Application) -> None:
        application.telegrams = self._sercos.telegrams

    def handle(self, events: int) -> None:
        if events & _segment.EVENT_EMERGENCY:
            self._sercos.send_emergency(self.core.emergency(self.position))
        super().handle(events & ~_segment.EVENT_EMERGENCY)

    def switch_mains(self, on: bool) -> None:
        """Switch the mains power on or off. Without it, the drive has no torque.

        Args:
            on: True to switch it on.
        """
        self._sercos.states.mains = on

    # -- for tests -----------------------------------------------------------------------------

    def idn_value(self, text: str) -> bytes:
        """Return the bytes of an IDN, with the lengths of a list.

        Args:
            text: IDN, such as "S-0-0047".

        Raises:
            ValueError: The text is not an IDN of the drive.
        """
        found = self._sercos.parameters.get(idn(text))
        if found is None:
            raise ValueError(f"{self.name} has no {text}")
        return found.value()

    @property
    def status(self) -> str:
        """State in bits 14 and 15 of S-0-0135."""
        return STATUS_NAMES[self.core.slot(self.position, STATUS_SLOT) >> STATUS_BITS & 3]
