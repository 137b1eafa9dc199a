"""Program for commissioning: it operates all devices of a segment, without motion of its own.

`catenary dashboard TARGET` starts it as `python -m catenary.operate TARGET SHARE`. It opens a loop
in the background with all drives disabled. Operators enable and jog them through the share.
"""

from catenary.operate.process import OperateProcess

__all__ = ["OperateProcess"]
