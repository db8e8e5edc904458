"""Communication periods that a kind of bus knows."""

from bisect import bisect_left, bisect_right
from math import inf
from typing import Final, NamedTuple

from busplan.elementwise import FIT_ROUNDING, Number, next_entry


class Periods(NamedTuple):
    """Communication periods that a kind of bus knows, ascending; without any it takes every period [us]."""

    us: tuple[float, ...] = ()

    @property
    def longest_us(self) -> float:
        """The longest of them; infinite where every period will do [us]."""
        return self.us[-1] if self.us else inf

    def knows(self, period_us: float) -> bool:
        """Whether a period is one of them.

        Examples
        --------
        >>> Periods((250.0, 500.0)).knows(300.0), Periods().knows(300.0)
        (False, True)
        """
        return not self.us or period_us in self.us

    def from_us(self, least_us: Number) -> Number:
        """The shortest of them that is no shorter than a time, but for float rounding; infinite where none is [us].

        Parameters
        ----------
        least_us
            The time [us]; of any sort.

        Examples
        --------
        >>> Periods((250.0, 500.0)).from_us(250.1), Periods().from_us(250.1)
        (500.0, 250.1)
        """
        if not self.us:
            return least_us
        return next_entry(self.us, least_us * (1 - FIT_ROUNDING), words="the next period that the bus knows")

    def neighbours(self, period_us: float) -> tuple[float, ...]:
        """The next shorter one and the next longer one, where they exist [us].

        Examples
        --------
        >>> Periods((250.0, 500.0)).neighbours(300.0), Periods((250.0, 500.0)).neighbours(100.0)
        ((250.0, 500.0), (250.0,))
        """
        shorter = self.us[: bisect_left(self.us, period_us)][-1:]
        return (*shorter, *self.us[bisect_right(self.us, period_us) :][:1])

    def refusal(self, period_us: float) -> str:
        """Say that a period is none of them, and which are next to it.

        Examples
        --------
        >>> Periods((250.0, 500.0)).refusal(300.0)
        'the bus knows no period of 300 us; the next are 250 and 500 us'
        """
        near = " and ".join(f"{one:g}" for one in self.neighbours(period_us))
        are = "are" if len(self.neighbours(period_us)) > 1 else "is"
        return f"the bus knows no period of {period_us:g} us; the next {are} {near} us"


ANY_PERIOD: Final = Periods()
"""Every period will do."""
