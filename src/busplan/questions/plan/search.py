"""The search: the least change of the dearest freedom with all cheaper ones free, then of the next dearest."""

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import lru_cache
from itertools import count
from math import inf
from typing import Final

from busplan.buses.parts import Cost, Value
from busplan.elementwise import within
from busplan.errors import BusplanError
from busplan.profile.toml import override
from busplan.questions.fit.circle_refusal import STEP
from busplan.questions.fit.network import network_of
from busplan.questions.plan.constraints import CIRCLE, Changes, Need, keeps_limits, most_asking, needs, refused_period
from busplan.questions.plan.freedoms import MOST_RATIO, PERIOD, RATIO, Freedom, longest_period_us
from busplan.sections.profile import Profile

FindCircleFailures = Callable[[Profile], tuple[str, ...]]
"""Runs the circle test of a profile that fits its bus: what it does not hold, nothing when it passes."""
MAX_CIRCLES: Final = 50
"""Periods tested in a row for the nearest one that passes the circle. Chosen: takes some seconds."""


_MOST_PROFILES: Final = 256
"""Profiles that a search keeps: each has a hundred kilobytes."""
_MOST_TRIES: Final = 600
"""Changes that a search tries, some milliseconds each, before it gives up."""


class Search:
    """Finds what to change in one profile; everything is computed once.

    Parameters
    ----------
    profile
        The network.
    circle
        Function that runs the circle test; None for none.
    kept
        Keys that must stay.
    max_circles
        Periods to test in a row with the circle before the strides double [1].
    """

    def __init__(
        self,
        profile: Profile,
        *,
        circle: FindCircleFailures | None = None,
        kept: Collection[str] = (),
        max_circles: int = MAX_CIRCLES,
    ) -> None:
        self._own = profile
        self._circle = circle if profile.asks_for_circle else None
        self.runs_circle = self._circle is not None
        """Whether the circle is tested where the bus fits."""
        self.kept = frozenset(kept)
        self.max_circles = max_circles
        self.proven = True
        """Whether no smaller change than the last one exists; False if the search for it was cut short."""
        self._left = _MOST_TRIES
        self._profile = lru_cache(maxsize=_MOST_PROFILES)(lambda key: override(profile, dict(key)))
        self._needs: dict[frozenset[tuple[str, Value]], list[Need]] = {}

    def least(self, levels: Sequence[Freedom], changes: Changes | None = None) -> Changes | None:
        """Find the least change after which every constraint holds.

        Parameters
        ----------
        levels
            Freedoms, the cheapest first.
        changes
            Changes made already.

        Returns
        -------
        dict or None
            All changes, the dearest first; empty if none is needed, None if no change of these is enough.
        """
        self.proven = True
        return self._least(levels, changes or {})

    def _least(self, levels: Sequence[Freedom], changes: Changes) -> Changes | None:
        if not levels:
            return changes if self.passes(changes) else None
        *cheaper, dearest = levels
        kept = self._least(cheaper, changes)
        if kept is not None:
            return kept
        for change in dearest.values(self, changes, cheaper):
            if self._left < 0:
                return None
            least = None if self.kept & set(change) else self._least(cheaper, {**changes, **change})
            if least is not None:
                return least
        return None

    def passes(self, changes: Changes) -> bool:
        """Whether every constraint holds after some changes, the circle last; False once too many circles were run."""
        self._left -= 1
        if self._left < 0:
            self.proven = False
            return False
        return (
            self._fits(changes)
            and not refused_period(self.profile(changes))
            # What a limit needs of the slice was asked with the profile's own slice ratio.
            and keeps_limits(network_of(self.profile(changes)))
            and not self.circle_failures(changes)
        )

    def circle_failures(self, changes: Changes) -> tuple[str, ...]:
        """Limits that the circle breaks after some changes that fit the bus; nothing where it is not run."""
        if self._circle is None:
            return ()
        return self._circle(self.profile(changes))

    # --- what a network needs, and what its slice gives it --------------------------------------------------

    def profile(self, changes: Changes) -> Profile:
        """The profile after some changes.

        Raises
        ------
        BusplanError
            The profile's schema refuses them.
        """
        return self._profile(frozenset(changes.items()))

    def allows(self, changes: Changes) -> bool:
        """Whether the profile's schema takes some changes."""
        try:
            self.profile(changes)
        except BusplanError:
            return False
        return True

    def needs(self, changes: Changes) -> list[Need]:
        """Needs of each constraint; they depend neither on period nor slice ratio nor step."""
        relevant = {key: value for key, value in changes.items() if key not in (PERIOD, RATIO, STEP)}
        key = frozenset(relevant.items())
        if key not in self._needs:
            self._needs[key] = needs(self.profile(relevant))
        return self._needs[key]

    def needed_us(self, changes: Changes, *, ratio: float) -> float:
        """The shortest period that gives all constraints what they ask, with a slice ratio [us]."""
        return max(need.period_us(ratio) for need in self.needs(changes))

    def period_us(self, changes: Changes) -> float:
        """Communication period after some changes [us]."""
        return float(changes.get(PERIOD, self._own.cycle.period_us))

    def ratio(self, changes: Changes) -> float:
        """Slice ratio after some changes [1]."""
        return float(changes.get(RATIO, self._own.cycle.slice_ratio))

    def in_strides(self, places: Sequence[int]) -> Iterator[int]:
        """Some of the places in their order: `max_circles` in a row, then with doubling strides, and the last."""
        at, stride = 0, 1
        for tried in count(1):
            if at >= len(places) - 1:
                break
            yield places[at]
            if tried >= self.max_circles and at + 1 < len(places) - 1:
                stride *= 2
                self.proven = False
            at += stride
        yield from places[-1:]

    # --- what is within reach -------------------------------------------------------------------------------

    def combinations(self, changes: Changes, levels: Sequence[Freedom]) -> Iterator[Changes]:
        """Every combination of what changes the need of a cycle."""
        if not levels:
            yield changes
            return
        *cheaper, last = levels
        yield from self.combinations(changes, cheaper)
        if not last.gives_time:
            proven = self.proven
            for change in last.values(self, changes, cheaper):
                if not self.kept & set(change):
                    yield from self.combinations({**changes, **change}, cheaper)
            self.proven = proven

    def furthest(self, changes: Changes, levels: Sequence[Freedom]) -> Changes:
        """The combination that needs least, with a step that divides the period and the largest ratio that is free."""
        ratio = self.most_ratio(changes, levels)

        def lacks(combination: Changes) -> tuple[float, bool]:
            return self.needed_us(combination, ratio=ratio), bool(refused_period(self.profile(combination)))

        least = min(self.combinations(changes, levels), key=lacks)
        return {**({} if ratio == self.ratio(changes) else {RATIO: ratio}), **least}

    def least_needed_us(self, changes: Changes, levels: Sequence[Freedom]) -> float:
        """The shortest period that gives all constraints what they ask, with some freedoms [us]."""
        ratio = self.most_ratio(changes, levels)
        return min(self.needed_us(combination, ratio=ratio) for combination in self.combinations(changes, levels))

    def most_ratio(self, changes: Changes, levels: Sequence[Freedom]) -> float:
        """The largest slice ratio with some freedoms [1]."""
        own = self.ratio(changes)
        return max(own, MOST_RATIO) if any(level.cost == Cost.HOST_TIME for level in levels) else own

    def most_period_us(self, changes: Changes, levels: Sequence[Freedom]) -> float:
        """The longest period with some freedoms [us]."""
        is_free = any(level.cost == Cost.PERIOD for level in levels)
        return longest_period_us(self._own) if is_free else self.period_us(changes)

    def is_bounded(self, levels: Sequence[Freedom]) -> bool:
        """Whether freedoms have a largest value: no period is free, and no limit of the bus is broken."""
        return all(level.cost != Cost.PERIOD for level in levels) and self.least_needed_us({}, levels) < inf

    def reaches(self, changes: Changes, levels: Sequence[Freedom]) -> bool:
        """Whether the bus fits with some freedoms, whatever its circle."""
        return bool(within(self.least_needed_us(changes, levels), self.most_period_us(changes, levels)))

    def binding(self, levels: Sequence[Freedom], changes: Changes | None = None) -> Need:
        """The constraint that no change of some freedoms holds.

        Parameters
        ----------
        levels
            Freedoms.
        changes
            Changes made already.
        """
        furthest = self.furthest(changes or {}, levels)
        most_us, ratio = self.most_period_us(furthest, levels), self.most_ratio(furthest, levels)
        worst = most_asking(self.needs(furthest), ratio=ratio)
        if not within(worst.period_us(ratio), most_us):
            return worst._replace(why=worst.words(ratio=ratio, most_us=most_us))
        refused = refused_period(self.profile(furthest))
        if refused:
            return refused
        failures = self.circle_failures(furthest) if self._fits(furthest) else ()
        words = "passes the circle" if self.runs_circle else "is one that the circle can be run at"
        return Need(inf, CIRCLE, failures[0] if failures else f"no period that was tried {words}")

    def _fits(self, changes: Changes) -> bool:
        return bool(within(self.needed_us(changes, ratio=self.ratio(changes)), self.period_us(changes)))
