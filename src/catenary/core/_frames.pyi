"""The frame engine; owned by Engine."""

class Frames:
    """Owner of the templates, images and tables of one cyclic exchange."""

    def __init__(self, plan: object, link: object) -> None: ...
