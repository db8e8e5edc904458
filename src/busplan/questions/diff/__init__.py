"""`busplan.diff`."""

import os
from dataclasses import dataclass

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.profile.revision import load_revision
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Models, ProfileLike, argument, checked_models, finite, load_profile
from busplan.questions.circle.check import circle_tests
from busplan.questions.diff import difference as analysis
from busplan.questions.diff.difference import CircleSide, ComparedFigure, Difference, KeyDifference
from busplan.sections.profile import Profile


@dataclass(frozen=True, slots=True, repr=False)
class DiffAnswer(Answer):
    """Answer of `diff`.

    Parameters
    ----------
    a, b
        The profiles; B is judged against A.
    keys
        The keys whose values differ, defaults applied.
    figures
        Every figure of both, with B - A and its `judgement`: "better", "worse", "same" or "neutral".
    circles
        Circle tests of A and B; None if neither asks for one, or none was to be run.
    arguments
        Names of A and B in the report: as they were given, and the name of a `Profile`.
    """

    a: Profile
    b: Profile
    keys: tuple[KeyDifference, ...]
    figures: tuple[ComparedFigure, ...]
    circles: tuple[CircleSide, CircleSide] | None
    arguments: tuple[str, str]

    @property
    def same(self) -> bool:
        """Whether no key differs."""
        return not self.keys

    def regressions(self, *, tolerance_percent: float = 0.0) -> tuple[ComparedFigure, ...]:
        """List the figures of B that are worse: those that `--fail-on-regression` fails for.

        Parameters
        ----------
        tolerance_percent
            How much worse a number may be than A's [%].

        Raises
        ------
        BusplanError
            The tolerance is negative or no number.
        """
        allowed = finite(tolerance_percent, name="tolerance_percent")
        if allowed < 0:
            raise BusplanError(f"tolerance_percent {allowed:g}: must be 0 or more")
        return tuple(self._found.regressions(tolerance=allowed / 100))

    def regression_words(self, *, tolerance_percent: float = 0.0) -> str:
        """Name the figures of B that are worse, in a sentence; empty if there are none.

        Parameters
        ----------
        tolerance_percent
            As for `regressions` [%].

        Raises
        ------
        BusplanError
            As for `regressions`.
        """
        from busplan.questions.diff.report import regression_words

        worse = self.regressions(tolerance_percent=tolerance_percent)
        return regression_words(self._found, worse, tolerance=tolerance_percent) if worse else ""

    def report(self) -> Report:
        """The answer in blocks."""
        from busplan.questions.diff.report import diff_report

        return diff_report(self._found, arguments=self.arguments)

    @property
    def _found(self) -> Difference:
        return Difference(self.a, self.b, self.keys, self.figures, self.circles)


def diff(
    a: ProfileLike,
    b: ProfileLike,
    *,
    timing_model: Models | None = None,
    circle: bool = True,
    progress: Progress | None = None,
    arguments: tuple[str, str] | None = None,
) -> DiffAnswer:
    """Tell what changed between two profiles, and what that does to every figure.

    Parameters
    ----------
    a, b
        The profile to compare with, and the one to judge: a `Profile`, a path, a shipped name, or REV:path for a file
        of a git revision, as "HEAD~1:profiles/line.toml".
    timing_model
        Name of a timing model, or several; by default all of the kind of bus. The verdict is always that of the
        model that decides.
    circle
        Run both circle tests if either profile asks for one.
    progress
        Called from time to time with the steps simulated and the steps known to be needed.
    arguments
        Names of A and B in the report; by default as they are given, and the name of a `Profile`.

    Returns
    -------
    DiffAnswer
        Its `figures` have the unit in their key: times are in us, contour errors in mm, shares 0..1.

    Raises
    ------
    BusplanError
        Not a profile, an unknown timing model, or one of two kinds of bus.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.diff("paper-1ms", "paper-optimal-gap", timing_model="standard", circle=False)
    >>> [(change.a.value, change.b.value) for change in answer.keys if change.key == "bus.gap_count"]
    [(63, 'optimal')]
    >>> [round(row.difference, 3) for row in answer.figures if row.figure.key == "margin_us"]
    [75.195]
    >>> answer.regressions()
    ()
    """
    (given_a, profile_a), (given_b, profile_b) = _given(a), _given(b)
    difference = analysis.difference(
        profile_a,
        profile_b,
        timing_models=None if timing_model is None else _models(timing_model, profile_a, profile_b),
        circle=circle_tests(progress) if circle else None,
    )
    return DiffAnswer(*difference, arguments=arguments or (given_a, given_b))


def _given(side: ProfileLike) -> tuple[str, Profile]:
    """One side as it was given, and its profile."""
    if isinstance(side, Profile):
        return side.name, side
    profile = load_revision(argument(side)).profile if isinstance(side, str) else load_profile(side)
    return os.fspath(side), profile


def _models(timing_model: Models, a: Profile, b: Profile) -> tuple[str, ...]:
    if a.bus.kind != b.bus.kind:
        raise BusplanError(
            f"timing_model {timing_model}: the kinds of bus, {a.bus.kind} and {b.bus.kind}, have no timing "
            "model in common; leave it out"
        )
    checked_models(timing_model, b)  # refuses a model that cannot express this one
    return checked_models(timing_model, a)
