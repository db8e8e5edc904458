"""`busplan.check`: do profiles fit their bus, hold their circle and keep what a baseline recorded?"""

import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from busplan.errors import BusplanError
from busplan.files import given_path
from busplan.forms.blocks import Report
from busplan.forms.numbers import sentence_text
from busplan.gate.baseline import Baseline, load_baseline
from busplan.gate.finding import MOST_STEPS, Recording
from busplan.gate.gate import FileResult, check_source
from busplan.gate.report import CheckReport, Located, check_report, summary_sentence
from busplan.gate.selection import Selection, checked_codes
from busplan.profile.changes import NO_CHANGES, KeyChanges
from busplan.profile.document import Document
from busplan.profile.edit import profile_text
from busplan.profile.sources import Collection, ProfileSource, collect
from busplan.questions.base.answer import Answer
from busplan.questions.base.arguments import FilePath, ProfileLike, argument, items, key_changes
from busplan.sections.profile import Profile
from busplan.sourced import changed_constants, constants_changed

NO_FILES: Final[Mapping[str, Sequence[str]]] = MappingProxyType({})


class CheckAnswer(Answer, CheckReport):
    """Answer of `check`: `files`, each with its findings, and their `summary`."""

    __slots__ = ()

    @property
    def findings(self) -> tuple[Located, ...]:
        """All findings by file and place, each with its `path` and source line."""
        return self.located

    @property
    def passed(self) -> bool:
        """Whether every file could be checked and compared with the baseline, and none has an error."""
        return not self.failed and not self.has_findings("error")

    def report(self) -> Report:
        """The answer in blocks."""
        return check_report(self)

    @property
    def headline(self) -> str:
        """Number of checked profiles, and of their errors and warnings."""
        return sentence_text(summary_sentence(self))

    def _headline(self) -> str:
        return self.headline


def check(
    paths: ProfileLike | Iterable[ProfileLike] | Collection,
    *,
    circle: bool = True,
    circle_steps: int = MOST_STEPS,
    changes: Mapping[str, object] | KeyChanges = NO_CHANGES,
    baseline: str | os.PathLike[str] | Baseline | None = None,
    pass_on_unmatched: bool = False,
    record: bool = False,
    recording: FilePath | None = None,
    quantile: float = 1.0,
    skip_others: bool = False,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    per_file_ignores: Mapping[str, Sequence[str]] = NO_FILES,
    executor: Executor | None = None,
) -> CheckAnswer:
    """Check whether profiles fit their bus and hold their circle.

    Parameters
    ----------
    paths
        One or several files, folders (every *.toml below with a `schema_version`), shipped names or `Profile`s; or the
        result of `busplan.profile.sources.collect`. A `Profile` is checked as the file that `busplan` would write of
        it, NAME.toml.
    circle
        Run the circle test of profiles that ask for one.
    circle_steps
        Most simulated steps of each axis of a circle: a longer one is not run, and has a warning.
    changes
        New values by dotted key, in the key's unit, for every file; each must be valid without them.
    baseline
        A file that `busplan check --update-baseline` recorded, or its content: a profile that lost axes or margin
        against it has an error. Profiles without a record and records without a profile are a `failure` of this file.
    pass_on_unmatched
        Let those pass; `unmatched` of the answer still names them.
    record
        Also give the `figures` and `keys` of each file that a baseline records.
    recording
        A recording of the machine, as `busplan.measured` takes it; for a single profile. A figure outside the plan is
        an error.
    quantile
        Share of the events that worst cases of the recording hold for, 0.5..1.
    skip_others
        Skip named files without a `schema_version`, and count them.
    select, ignore
        Rules that count, and others that do not, by the beginning of their code: the longest that fits decides. By
        default all count. What does not is among the `suppressed` of its file.
    per_file_ignores
        Rules that do not count by the pattern of a path: {"old/*.toml": ["BP112"]}.
    executor
        Where the files are checked; by default in this thread. Any `concurrent.futures.Executor` gives the same answer,
        and is not shut down. Worker processes must have this version of busplan.

    Returns
    -------
    CheckAnswer
        Findings with code, message, key, line and column. A file that cannot be read raises nothing: it has a
        `failure`, and the others are checked.

    Raises
    ------
    BusplanError
        No path, standard input, an invalid change, or no baseline of these timing models.
    Exception
        Anything that `executor` raises.

    Examples
    --------
    >>> import busplan
    >>> answer = busplan.check(["paper-4ms", "paper-dma"])
    >>> answer.passed, answer.summary
    (True, Summary(files=2, errors=0, warnings=0, circles_not_run=0, suppressed=3))
    """
    changed = changes if isinstance(changes, KeyChanges) else key_changes(changes)
    _ = changed.changed_constants  # Unknown constants are refused here, once for all files.
    recorded = None if baseline is None else _recorded(baseline)
    collection, profiles = (paths, []) if isinstance(paths, Collection) else _collected(paths, skip_others=skip_others)
    if recording is not None and len(collection.sources) + len(profiles) != 1:
        raise BusplanError(f"recording {os.fspath(recording)}: needs exactly one profile, that of its machine")
    options: dict[str, Any] = {
        "recording": None if recording is None else Recording(recording, quantile),
        "with_circle": circle,
        "circle_steps": circle_steps,
        "changes": changed,
        "record": record,
        "selection": Selection(
            checked_codes(select, name="select"),
            checked_codes(ignore, name="ignore"),
            tuple((pattern, checked_codes(codes, name="ignore")) for pattern, codes in per_file_ignores.items()),
        ),
    }
    check_file = partial(check_source, options=options)
    in_memory = [Document(f"{profile.name}.toml", profile_text(profile)) for profile in profiles]
    files: tuple[ProfileSource | Document, ...] = (*collection.sources, *in_memory)
    names = [_record_name(file, recorded) for file in files]
    records = [None if recorded is None else recorded.profiles.get(name) for name in names]
    # Only this process can read standard input and profiles in memory.
    is_here = [executor is None or isinstance(file, Document) or str(file.path) == "-" for file in files]
    there = [pair for pair, here in zip(zip(files, records, strict=True), is_here, strict=True) if not here]
    checked = executor.map(check_file, *zip(*there, strict=True)) if executor is not None and there else iter(())
    # A profile in memory keeps the constants that were changed in it.
    of_memory = dict(zip(map(id, in_memory), (profile.constants for profile in profiles), strict=True))

    def checked_here(file: ProfileSource | Document, record: Any) -> FileResult:
        with constants_changed(of_memory.get(id(file), changed_constants())):
            return check_file(file, record)

    results = [
        checked_here(file, record) if here else next(checked)
        for file, record, here in zip(files, records, is_here, strict=True)
    ]
    unmatched = "" if recorded is None else _unmatched(recorded, names, results)
    if unmatched and not pass_on_unmatched:
        results.append(FileResult(str(recorded), None, (), {}, failure=unmatched))
    return CheckAnswer(tuple(results), changed, len(collection.skipped) if skip_others else 0, unmatched)


def _record_name(file: ProfileSource | Document, recorded: Baseline | None) -> str:
    source = ProfileSource(Path(file.name), file.name) if isinstance(file, Document) else file
    return source.name if recorded is None else recorded.name_of(source)


def _unmatched(recorded: Baseline, names: Sequence[str], results: Sequence[FileResult]) -> str:
    unknown = [
        result.path
        for name, result in zip(names, results, strict=True)
        if result.fit is not None and name not in recorded.profiles
    ]
    return recorded.unmatched(unknown, checked=names)


def _collected(paths: ProfileLike | Iterable[ProfileLike], *, skip_others: bool) -> tuple[Collection, list[Profile]]:
    """Files of the arguments, and profiles in memory."""
    # A profile is iterable, too: over its sections.
    several = [paths] if isinstance(paths, str | os.PathLike | Profile) else items(paths, name="paths")
    profiles = [profile for profile in several if isinstance(profile, Profile)]
    files = [argument(profile) for profile in several if not isinstance(profile, Profile)]
    return collect(files, skip_others=skip_others), profiles


def _recorded(baseline: str | os.PathLike[str] | Baseline) -> Baseline:
    recorded = baseline if isinstance(baseline, Baseline) else load_baseline(given_path(baseline))
    if not recorded.is_current:
        raise BusplanError(
            f"{recorded}: recorded by other timing models, so its figures cannot be compared; record it again with "
            "--update-baseline"
        )
    return recorded
