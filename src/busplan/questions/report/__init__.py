"""`busplan.report`."""

import os
from collections.abc import Iterable
from dataclasses import dataclass

from busplan.errors import BusplanError
from busplan.forms.blocks import Report
from busplan.forms.numbers import plural
from busplan.printable import has_controls
from busplan.profile.changes import NO_CHANGES
from busplan.progress import Progress
from busplan.questions.base.answer import Answer
from busplan.questions.base.inputs import Origin, ProfileLike, load_profile, one_or_several, origin_of
from busplan.questions.report.all_answers import AllAnswers, answers_of_each
from busplan.questions.report.page import ReportedProfile, page_report
from busplan.questions.words.documents import changed_report
from busplan.sections.profile import Profile


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class ReportAnswer(Answer):
    """Answer of `report`: a page. `html` is its text, `save(path)` writes it.

    Parameters
    ----------
    profiles
        Each profile with its `argument` in the page's commands, and all its answers.
    title
        Heading of the page; None for the profile's name or the number of profiles.
    """

    profiles: tuple[ReportedProfile, ...]
    title: str | None

    @property
    def answers(self) -> tuple[AllAnswers, ...]:
        """All answers for each profile."""
        return tuple(profile.answer for profile in self.profiles)

    def report(self) -> Report:
        """The answer in blocks."""
        page, changes = page_report(self.profiles, title=self.title), self.profiles[0].changes
        # As on the command line, where all profiles have the same ones.
        return changed_report(page, changes) if all(profile.changes == changes for profile in self.profiles) else page

    def _headline(self) -> str:
        return "; ".join(f"{answer.profile.name}: {answer.verdict.deciding.verdict}" for answer in self.answers)


def report(
    profiles: ProfileLike | Iterable[ProfileLike],
    *,
    title: str | None = None,
    circle: bool = True,
    progress: Progress | None = None,
    origins: Iterable[Origin] | None = None,
) -> ReportAnswer:
    """Put all that busplan says of one or several profiles on one page.

    Parameters
    ----------
    profiles
        One or several: a `Profile`, a path or a shipped name each. The page names commands that repeat its figures;
        in those of a `Profile` stands the shipped one it was made from with its changes, else NAME.toml.
    title
        Heading of the page; by default the profile's name, or how many profiles.
    circle
        Run the circle test of profiles that ask for one.
    progress
        Called from time to time with the steps simulated and the steps known to be needed.
    origins
        How the page's commands give each profile, if not as above: a PROFILE argument, and the changes by options that
        the profile has already.

    Returns
    -------
    ReportAnswer
        Its `html` is the page, one file without network or script; `save("report.html")` writes it, and .md, .txt and
        .json. A notebook shows it.

    Raises
    ------
    BusplanError
        Not a profile, a title that is no words in one line, or not an origin for each profile.

    Examples
    --------
    >>> import busplan
    >>> page = busplan.report(["paper-4ms", "paper-1ms"], circle=False)
    >>> page
    <ReportAnswer: paper-4ms: fits; paper-1ms: fits>
    >>> page.html.splitlines()[0], page.answers[0].verdict.deciding.safe_axes
    ('<!DOCTYPE html>', 52)
    """
    if title is not None and (not isinstance(title, str) or has_controls(title) or not title.strip()):
        raise BusplanError(f"title {title!r}: expected words in one line, without control characters")
    # A profile is iterable, too: over its sections.
    given = [profiles] if isinstance(profiles, Profile) else one_or_several(profiles, name="profiles")
    loaded = [load_profile(profile) for profile in given]
    if origins is None:
        origins = [
            origin_of(profile) if isinstance(profile, Profile) else (os.fspath(profile), NO_CHANGES)
            for profile in given
        ]
    named = list(origins)
    if len(named) != len(given):
        raise BusplanError(f"origins: {len(named)} for {plural(len(given), 'profile')}; expected one for each")
    answers_ = answers_of_each(loaded, with_circle=circle, progress=progress)
    return ReportAnswer(
        tuple(
            ReportedProfile(argument, answer, changes)
            for (argument, changes), answer in zip(named, answers_, strict=True)
        ),
        title,
    )
