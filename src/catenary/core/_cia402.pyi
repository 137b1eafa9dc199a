"""CiA 402: the state from a statusword, and the controlword towards a requested state."""

REQUEST_DISABLED: int  # 0
REQUEST_ENABLED: int  # 1
REQUEST_QUICK_STOP: int  # 2
REQUEST_RESET: int  # 3: as disabled, and acknowledge a fault
CODING: tuple[tuple[int, int, int], ...]  # mask, value, state
COMMANDS: tuple[tuple[int, int, int, int], ...]  # by state: command bits for each requested state

def state_of(statusword: int) -> int:
    """Return the state in a statusword; 255 if its bits match none.

    0 not ready to switch on, 1 switch on disabled, 2 ready to switch on, 3 switched on, 4 operation
    enabled, 5 quick stop active, 6 fault reaction active, 7 fault.
    """

def controlword_towards(state: int, requested_state: int, previous: int) -> int:
    """Return the command bits (0 to 3 and 7) that lead from `state` towards a requested state.

    A fault is reset by a rising edge of bit 7. Before it, the commands of an enabled drive are
    cleared. The bit stays set until the fault has ended.

    Args:
        state: The drive's state, as `state_of` returns it.
        requested_state: Requested state, a REQUEST_* number.
        previous: The controlword sent last.

    Raises:
        ValueError: `requested_state` is not 0 to 3.
    """
