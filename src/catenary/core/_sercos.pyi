"""SERCOS drives: S-0-0135 → CiA 402 statusword, CiA 402 controlword → S-0-0134."""

STATUS: tuple[tuple[int, int, int], ...]  # mask, value of S-0-0135, statusword; first match
CONTROL: tuple[tuple[int, int], ...]  # command bits, S-0-0134; 0 for other commands

def statusword_of(status: int) -> int:
    """Return the CiA 402 statusword for S-0-0135: state bits and bit 12."""

def control_word_of(controlword: int, reacts: bool = False) -> int:
    """Return S-0-0134 for a CiA 402 controlword, without the synchronisation bit.

    Args:
        controlword: CiA 402 controlword; bits 0 to 3 have an effect.
        reacts: True while the drive brakes after a fault. Bit 14 is then kept.
    """
