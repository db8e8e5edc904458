"""What a command takes, the public function of its question takes, too, and the other way round."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import pytest

import busplan
from busplan.cli.lazy import COMMANDS, LazyCommands

FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "import": busplan.import_profile,
    "plan": busplan.plan,
    "calibrate": busplan.calibrate,
    "measured": busplan.measured,
    "map": busplan.map_,
    "sweep": busplan.sweep,
    "compare": busplan.compare,
    "capacity": busplan.capacity,
    "latency": busplan.latency,
    "circle-test": busplan.circle_test,
    "timeline": busplan.timeline,
    "explain": busplan.explain,
    "report": busplan.report,
    "check": busplan.check,
    "diff": busplan.diff,
    "evidence": busplan.evidence,
    "paper": busplan.evidence,
}
NO_QUESTION = {
    "init": "writes a profile to start from",
    "rule": "a page of the reference",
    "schema": "a file for editors",
    "manual": "pages of the reference",
    "profiles": "a list of files",
}
Reasons = Mapping[str | tuple[str, str], str]
"""By option or parameter of every command, or by command and option or parameter."""

PYTHON_NAMES: Mapping[str, str] = {
    "timing": "timing_model",
    "period": "period_us",
    "payload": "payload_bytes",
    "from": "from_us",
    "to": "to_us",
}
"""Parameter of an option whose value has its unit, or needs no longer word."""

WITH_THE_PROFILE: Reasons = {
    "set": "load_profile(profile, changes=...)",
    **{(name, "period"): "the same" for name in ("timeline", "map", "compare", "report")},
}
TERMINAL_OR_FILES: Reasons = {
    "all": "rows and columns on a terminal",
    "format": "save(path) goes by the ending",
    "output": "save(path)",
    ("import", "force"): "replaces an old file",
    ("plan", "force"): "replaces an old file",
    "plot": "save(path)",
    "figure": "which figure --plot draws",
    "trace": "trace_csv(), and arrays by runs[0].trace()",
    "every": "of --trace",
    "apply": "the answer's changes, into the profile's file",
    "columns": "of the table on a terminal: the answer has all",
    "sort": "of the table on a terminal",
    "top": "of the table on a terminal",
    "jobs": "processes: an executor",
    "cluster": "an executor",
    "fail_on": "exit code",
    "exit_zero": "exit code",
    "fail_on_regression": "exit code: regressions()",
    "tolerance": "of --fail-on-regression: regressions(tolerance_percent=...)",
    "baseline": "a file of the gate",
    "update_baseline": "a file of the gate",
    "skip_others": "which files of a folder",
    "stdin_filename": "name of standard input",
    "quiet": "what is printed",
    "verbose": "what is printed",
}
"""Options that no function needs, of every command or of one, with the reason or what Python has instead."""
PYTHON_ALONE: Reasons = {
    "progress": "a terminal draws it",
    "executor": "--jobs and --cluster",
    ("calibrate", "source"): "a file has its name",
    ("check", "changes"): "--set",
    ("check", "record"): "--update-baseline",
    ("diff", "arguments"): "the profiles as typed",
    ("evidence", "paper"): "a command of its own",
    ("import", "name"): "that of --output",
    ("paper", "paper"): "the command is its value",
    ("paper", "kind"): "the paper is of one kind",
    ("plan", "gap_count"): "--set bus.gap_count",
    ("plan", "reserve"): "--set limits.reserve",
    ("plan", "wanted"): "--set",
    ("report", "origins"): "the profiles as typed",
}
"""Parameters without an option of that name, of every function or of that of one command."""


def options(command: str) -> set[str]:
    """Arguments and options by name."""
    return {one.name.rstrip("_") for one in LazyCommands()[command].params}


def parameters(command: str) -> set[str]:
    return set(inspect.signature(FUNCTIONS[command]).parameters)


def test_every_command_has_a_function_or_a_reason_for_none() -> None:
    assert {*FUNCTIONS, *NO_QUESTION} == set(COMMANDS)
    assert not FUNCTIONS.keys() & NO_QUESTION.keys()
    answered = {one.__name__ for one in FUNCTIONS.values()}
    is_function = (name for name in busplan.__all__ if inspect.isfunction(getattr(busplan, name)))
    assert answered == {*is_function} - {"load_profile"}


@pytest.mark.parametrize("command", FUNCTIONS)
def test_what_a_command_takes_its_function_takes(command: str) -> None:
    taken = {name for name in options(command) if {name, PYTHON_NAMES.get(name, name)} & parameters(command)}
    elsewhere = {*WITH_THE_PROFILE, *TERMINAL_OR_FILES}
    assert {name for name in options(command) - taken if not {name, (command, name)} & elsewhere} == set()


@pytest.mark.parametrize("command", FUNCTIONS)
def test_what_a_function_takes_its_command_takes(command: str) -> None:
    taken = {spelled for name in options(command) for spelled in (name, PYTHON_NAMES.get(name, name))}
    assert {name for name in parameters(command) - taken if not {name, (command, name)} & PYTHON_ALONE.keys()} == set()


def test_no_reason_is_left_of_what_is_gone() -> None:
    taken = {one for command in FUNCTIONS for name in options(command) for one in (name, (command, name))}
    assert {*PYTHON_NAMES, *WITH_THE_PROFILE, *TERMINAL_OR_FILES} <= taken
    assert not taken & {one for one in PYTHON_ALONE if isinstance(one, tuple)}


@pytest.mark.parametrize("command", FUNCTIONS)
def test_a_default_is_the_same_in_both(command: str) -> None:
    """An option without a default leaves it to the function."""
    own = inspect.signature(FUNCTIONS[command]).parameters
    for option in LazyCommands()[command].params:
        name = option.name.rstrip("_")
        if name in own and own[name].default is not inspect.Parameter.empty and not callable(option.default):
            assert option.default in (None, own[name].default), name
