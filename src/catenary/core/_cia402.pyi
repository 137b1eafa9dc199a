"""The CiA 402 step: a state from the statusword, a controlword towards a goal."""

GOAL_DISABLED: int  # 0
GOAL_ENABLED: int  # 1
GOAL_QUICK_STOP: int  # 2
GOAL_RESET: int  # 3: as disabled, and a fault is acknowledged
CODING: tuple[tuple[int, int, int], ...]  # mask, value, state
COMMANDS: tuple[tuple[int, int, int, int], ...]  # by state: towards each goal

def state_of(statusword: int) -> int:
    """The state a statusword shows: 0 not ready to switch on, 1 switch on disabled, 2 ready to
    switch on, 3 switched on, 4 operation enabled, 5 quick stop active, 6 fault reaction active,
    7 fault; 255 when its bits match none."""

def controlword_towards(state: int, goal: int, previous: int) -> int:
    """The controlword's command bits (0 to 3 and 7) that lead from `state` towards `goal`.

    `previous` is the controlword sent last: a fault is reset by a rising edge of bit 7, after the
    commands of an enabled drive were cleared, and stays set until the fault is gone. ValueError for
    a goal other than 0 to 3.
    """
