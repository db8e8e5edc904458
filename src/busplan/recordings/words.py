"""Words of readers and of what they read."""


def counted(number: int, name: str) -> str:
    """A number of things.

    Examples
    --------
    >>> counted(1, "frame"), counted(1200, "frame")
    ('1 frame', '1,200 frames')
    """
    return f"{number:,} {name}{'s' * (number != 1)}"
