from catenary.virtual._segment import Core

class Motors:
    def __init__(self, core: Core) -> None: ...
    def make(
        self,
        position: int,
        axis: int,
        *,
        inertia: float,
        viscous: float,
        coulomb: float,
        rated_torque: float,
        velocity_limit: float,
        counts_per_radian: float,
        velocity_per_radian: float,
        position_gain: float,
        velocity_gain: float,
        integral_gain: float,
        boot: float,
    ) -> None: ...
    def set_quirks(
        self,
        position: int,
        axis: int,
        *,
        mode_delay: float,
        refused_modes: int,
        never_bit_12: bool,
        follows_without_bit_12: bool,
        ignores_quick_stop: bool,
        ignores_disable: bool,
    ) -> None: ...
    def hide_bit_12(self, position: int, axis: int, seconds: float) -> None: ...
    def state(self, position: int, axis: int) -> tuple[float, float, float, int]: ...
    def tune(
        self, position: int, axis: int, *, velocity_gain: float, integral_gain: float
    ) -> None: ...
    def place(self, position: int, axis: int, to: float) -> None: ...
    def load(self, position: int, axis: int, load: float) -> None: ...
    def inject(self, position: int, axis: int, code: int) -> None: ...
    def stop_torque(self, position: int, axis: int, active: bool) -> None: ...
    def set_probe_quirks(
        self, position: int, axis: int, *, toggles: bool, keeps_stored: bool, one_edge: bool
    ) -> None: ...
    def set_probe_switch(
        self, position: int, axis: int, number: int, first: float, end: float
    ) -> None: ...
    def set_probe_input(self, position: int, axis: int, number: int, level: bool) -> None: ...
