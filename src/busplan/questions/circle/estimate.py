"""What a circle test costs, before it runs."""

import logging
from collections.abc import Sequence
from typing import Final, NamedTuple

from busplan.questions.circle.contributions import Setup
from busplan.servo.engine import compiled_kernel

_AXES: Final = 2
_STEP_US: Final = {True: 0.08, False: 0.5}
"""Time for a step of one axis with its measures, by whether the kernel is compiled; measured on a machine of 2024."""
_SETPOINT_US: Final = 1.5
_STEP_BYTES: Final = 18
"""Positions of both axes, and what is computed from them at a time."""
_SETPOINT_BYTES: Final = 200
_LONG_S: Final = 10.0


class Estimate(NamedTuple):
    """What some simulations cost, about."""

    steps: int
    """Simulated steps, an axis at a time."""
    time_s: float
    memory_bytes: float

    def then(self, other: "Estimate") -> "Estimate":
        """What this costs and, when its memory is free again, another.

        Parameters
        ----------
        other
            What comes behind.
        """
        memory_bytes = max(self.memory_bytes, other.memory_bytes)
        return Estimate(self.steps + other.steps, self.time_s + other.time_s, memory_bytes)

    @property
    def is_long(self) -> bool:
        """Whether it is worth a word before it starts."""
        return self.time_s > _LONG_S

    @property
    def text(self) -> str:
        """The estimate in words."""
        engine = "" if compiled_kernel("auto") else ", in plain Python"
        memory = f"{self.memory_bytes / 1e9:.2g} GB"
        return f"circle test: {self.steps:,} steps, about {self.time_s:.0f} s and {memory}{engine}"


NOTHING: Final = Estimate(0, 0.0, 0.0)
"""What no simulation costs."""


def estimate(kept: Sequence[Setup], passing: Sequence[Setup] = ()) -> Estimate:
    """Estimate what simulations cost.

    Parameters
    ----------
    kept
        Simulations whose positions are kept, one for each period.
    passing
        Simulations that are only measured.
    """
    rate_us = _STEP_US[compiled_kernel("auto") is not None]
    every = [*kept, *passing]
    sizes = [_STEP_BYTES * one.steps + _SETPOINT_BYTES * one.path.setpoints for one in every]
    return Estimate(
        steps=_AXES * sum(one.steps for one in every),
        time_s=sum(_AXES * rate_us * one.steps + _SETPOINT_US * one.path.setpoints for one in every) / 1e6,
        memory_bytes=sum(sizes[: len(kept)]) + max(sizes[len(kept) :], default=0),
    )


def announce(cost: Estimate) -> None:
    """Say what a long run costs; without a handler of its own, `logging` writes it to standard error.

    Parameters
    ----------
    cost
        The estimate; a short run is not announced.
    """
    if cost.is_long:
        logging.getLogger("busplan").warning(cost.text)
