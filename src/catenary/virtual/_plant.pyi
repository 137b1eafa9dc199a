from catenary.virtual._segment import Core

class CompiledPlant:
    def __init__(
        self,
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
        brake_delay_ns: int = 0,
    ) -> None: ...
    def hang(self, n: int, core: Core, position: int, axis: int) -> None: ...
    def show(
        self,
        value: int,
        core: Core,
        position: int,
        slot: int,
        *,
        scale: float,
        bias: float,
        noise: float,
        seed: int,
    ) -> None: ...
    def free(self, active: int) -> None: ...
    def add_member(self, core: Core) -> None: ...
    def run(self) -> None: ...
    def end(self) -> None: ...
    @property
    def steps(self) -> int: ...
    @property
    def wild(self) -> int: ...
    @property
    def apart(self) -> bool: ...
    @property
    def complaint(self) -> str: ...
