"""Time of each device's process-data watchdog, ETG.1000.4 §6.3 (registers 0x0400, 0x0420).

After a crash of the MainDevice a drive uses its last outputs until the watchdog expires. In CSP and
CSV its own control loops hold the axis until then. In CST it applies a stale torque, so the default
is short.

The watchdog time of an ESI or ENI replaces the default of 100 ms, but not the short one in CST.
These files never disable the watchdog; only the application does.
"""

from __future__ import annotations

from catenary.model.device import DeviceDescription
from catenary.plan.request import DeviceRequest
from catenary.plan.start_up import WATCHDOG_DIVIDER, WATCHDOG_UNIT_NS
from catenary.wire.cia402 import SLOT_OFFSET, Object
from catenary.wire.register import watchdog_unit_ns

DEFAULT_NS = 100_000_000
TORQUE_NS = 10_000_000  # shortest default in CST
TORQUE_EXCHANGES = 5  # shortest default in CST [exchanges of the device]
LEAST_EXCHANGES = 3  # shortest watchdog time [exchanges of the device]
COUNT_MAX = 0xFFFF
SLOTS = 8  # axes of a device, ETG.6010
TARGET_TORQUES = frozenset(Object.TARGET_TORQUE + SLOT_OFFSET * slot for slot in range(SLOTS))


def choose_watchdog(
    device: DeviceDescription, request: DeviceRequest, seconds: float | None, period_ns: int
) -> tuple[int, str]:
    """Return the watchdog time of a device [ns], 0 for off, and its source in a file.

    Args:
        device: Device, for error messages.
        request: Process-data request of the device. A required target torque means CST.
        seconds: Time that the application requests [s]; 0: off; None: the default.
        period_ns: Period of the cycle [ns].

    Raises:
        ValueError: The register cannot hold the time, or it is shorter than three exchanges.
    """
    exchange_ns = period_ns * request.divider
    source = ""
    if seconds is not None:
        watchdog_ns = _rounded(seconds)
    elif _is_torque_controlled(request):
        longest = max(TORQUE_NS, TORQUE_EXCHANGES * exchange_ns)
        watchdog_ns = -(-longest // WATCHDOG_UNIT_NS) * WATCHDOG_UNIT_NS
    else:
        watchdog_ns = _esi_watchdog_ns(device)
        source = f"{device.commands_origin} {device.esi}".strip()
        if watchdog_ns < max(LEAST_EXCHANGES * exchange_ns, WATCHDOG_UNIT_NS):
            watchdog_ns, source = DEFAULT_NS, ""
    _check(device, request, watchdog_ns, period_ns)
    return watchdog_ns, source


def _esi_watchdog_ns(device: DeviceDescription) -> int:
    """Return the watchdog time of the ESI [ns]; 0 if it gives none that the register can hold."""
    values = device.watchdog
    if not values.process_data:
        return 0
    divider = WATCHDOG_DIVIDER if values.divider is None else values.divider
    count = round(values.process_data * watchdog_unit_ns(divider) / WATCHDOG_UNIT_NS)
    return count * WATCHDOG_UNIT_NS if count <= COUNT_MAX else 0


def _rounded(seconds: float) -> int:
    """Return the nearest multiple of the register's unit [ns].

    Raises:
        ValueError: The register cannot hold the time.
    """
    count = round(seconds * 1e9 / WATCHDOG_UNIT_NS)
    if seconds != 0 and not 0 < count <= COUNT_MAX:
        raise ValueError(_range(seconds))
    return count * WATCHDOG_UNIT_NS


def _range(seconds: float) -> str:
    unit = WATCHDOG_UNIT_NS * 1e-9
    return f"watchdog of {seconds:g} s: use {unit:.4f} to {unit * COUNT_MAX:.4f} s, or 0 for off"


def _is_torque_controlled(request: DeviceRequest) -> bool:
    return any(o.required and o.index in TARGET_TORQUES for o in request.outputs)


def _check(
    device: DeviceDescription, request: DeviceRequest, watchdog_ns: int, period_ns: int
) -> None:
    if watchdog_ns > COUNT_MAX * WATCHDOG_UNIT_NS:
        raise ValueError(_range(watchdog_ns * 1e-9))
    if watchdog_ns == 0 or watchdog_ns >= LEAST_EXCHANGES * period_ns * request.divider:
        return
    seconds, period = watchdog_ns * 1e-9, period_ns * 1e-9
    if watchdog_ns < LEAST_EXCHANGES * period_ns:
        raise ValueError(
            f"watchdog of {seconds:.4f} s would expire after fewer than {LEAST_EXCHANGES} periods "
            f"of {period} s; use a longer Loop(watchdog=...)"
        )
    raise ValueError(
        f"{device}: exchanged every {request.divider} cycles of {period} s, fewer than "
        f"{LEAST_EXCHANGES} times within the watchdog of {seconds:.4f} s; use a smaller divider, "
        "or a longer Loop(watchdog=...)"
    )
