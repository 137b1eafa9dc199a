import os
from collections.abc import Sequence

from catenary.link._table import TableLink

class Replay(TableLink):
    def __init__(
        self, recording: str | os.PathLike[str] | Sequence[tuple[bytes, bytes]]
    ) -> None: ...
    @property
    def answered(self) -> int: ...
    @property
    def unmatched(self) -> int: ...
    @property
    def first_unmatched(self) -> bytes | None: ...
