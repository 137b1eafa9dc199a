from catenary.virtual._segment import Core

class CompiledPlant:
    def __init__(
        self,
        core: Core,
        joints: int,
        *,
        step: int,
        set_handler: int,
        model: int,
        data: int,
        period_ns: int,
        keep: object,
    ) -> None: ...
    def make_joint(
        self,
        n: int,
        *,
        q: int,
        v: int,
        force: int,
        friction: int,
        ratio: float,
        zero: float,
        dry: float,
        brake: float,
        brake_delay_ns: int,
    ) -> None: ...
    def hang(self, n: int, position: int, axis: int) -> None: ...
    def begin(self) -> None: ...
    def run(self) -> None: ...
    def end(self) -> None: ...
    @property
    def steps(self) -> int: ...
    @property
    def wild(self) -> int: ...
    @property
    def complaint(self) -> str: ...
