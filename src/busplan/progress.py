"""Progress of long work."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called from time to time with the work done and the total work."""
