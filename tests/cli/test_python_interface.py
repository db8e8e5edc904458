"""What a command takes, the public function of its question takes, too, and the other way round."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import pytest

import busplan
from tests.registers import COMMAND_LINE, COMMANDS

FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "import": busplan.import_profile,
    "plan": busplan.plan,
    "calibrate": busplan.calibrate,
    "measured": busplan.measured,
    "map": busplan.map_,
    "emulate": busplan.emulate,
    "explore": busplan.explore,
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
WITH_THEIR_UNIT = {
    "bit_rate": "bit_rate_kbit_s",
    "period": "period_us",
    "duration": "duration_us",
    "payload": "payload_bytes",
    "from": "from_us",
    "to": "to_us",
}
"""Parameter of an option whose value has its unit; every other one has the option's name."""
OPTIONS_ALONE: Mapping[str | tuple[str, str], str] = {
    "set": "load_profile(profile, changes=...)",
    **{
        (name, "period"): "the same"
        for name in ("latency", "emulate", "timeline", "map", "explore", "compare", "report")
    },
    "all": "rows and columns on a terminal",
    "no_pager": "where a terminal shows it",
    "format": "save(path) goes by the ending",
    "output": "save(path)",
    ("import", "force"): "replaces an old file",
    ("plan", "force"): "replaces an old file",
    ("measured", "bit_rate"): "recorded(log, bit_rate_kbit_s=...)",
    ("measured", "data_bit_rate"): "the same",
    "trace": "trace_csv(), and arrays by runs[0].trace()",
    "every": "of --trace",
    "apply": "the answer's changes, into the profile's file",
    "jobs": "processes: an executor",
    "cluster": "an executor",
    "fail_on": "exit code",
    "show_suppressed": "what is printed",
    "exit_zero": "exit code",
    "fail_on_regression": "exit code: regressions()",
    "tolerance": "of --fail-on-regression: regressions(tolerance_percent=...)",
    "update_baseline": "a file of the gate",
    "stdin_filename": "name of standard input",
    "quiet": "what is printed",
    "verbose": "what is printed",
}
"""Options that no function needs, of every command or of one, with the reason or what Python has instead."""
PARAMETERS_ALONE: Mapping[str | tuple[str, str], str] = {
    "progress": "a terminal draws it",
    "executor": "--jobs and --cluster",
    ("calibrate", "source"): "a file has its name",
    ("check", "changes"): "--set",
    ("check", "record"): "--update-baseline",
    ("check", "per_file_ignores"): "busplan.toml",
    ("diff", "arguments"): "the profiles as typed",
    ("evidence", "paper"): "a command of its own",
    ("import", "name"): "that of --output",
    ("paper", "paper"): "the command is its value",
    ("paper", "kind"): "the paper is of one kind",
    ("plan", "changes"): "--set",
    ("report", "origins"): "the profiles as typed",
}
"""Parameters without an option of that name, of every function or of that of one command."""


def options(command: str) -> dict[str, Any]:
    """Arguments and options of a command, by the name of the parameter that takes the same."""
    own = inspect.signature(FUNCTIONS[command]).parameters
    names = {one.name.rstrip("_"): one for one in COMMAND_LINE.get_command(None, command).params}
    spelled = {name: WITH_THEIR_UNIT.get(name, name) for name in names}
    return {spelled[name] if spelled[name] in own else name: one for name, one in names.items()}


def test_every_command_has_a_function_or_a_reason_for_none() -> None:
    assert {*FUNCTIONS, *NO_QUESTION} == set(COMMANDS)
    answered = {one.__name__ for one in FUNCTIONS.values()}
    is_function = (name for name in busplan.__all__ if inspect.isfunction(getattr(busplan, name)))
    # `measured` of a log alone is `recorded`.
    assert answered == {*is_function} - {"load_profile", "recorded"}


@pytest.mark.parametrize("command", FUNCTIONS)
def test_a_command_and_its_function_take_the_same_with_the_same_defaults(command: str) -> None:
    there = inspect.signature(FUNCTIONS[command]).parameters
    here = options(command)
    for name, option in here.items():
        if name not in there:
            assert {name, (command, name)} & OPTIONS_ALONE.keys(), name
        elif there[name].default is not inspect.Parameter.empty and not callable(option.default):
            # Without a default an option leaves it to the function, which takes None for both timing models.
            assert option.default in (None, there[name].default) or (option.default, name) == ("both", "timing_model")
    for name in there.keys() - here.keys():
        assert {name, (command, name)} & PARAMETERS_ALONE.keys(), name


def test_no_reason_is_left_of_what_is_gone() -> None:
    each = {command: (options(command), inspect.signature(FUNCTIONS[command]).parameters) for command in FUNCTIONS}
    alone = {
        one
        for command, (here, there) in each.items()
        for name in here.keys() - there.keys()
        for one in (name, (command, name))
    }
    assert alone >= {*OPTIONS_ALONE}
    alone = {
        one
        for command, (here, there) in each.items()
        for name in there.keys() - here.keys()
        for one in (name, (command, name))
    }
    assert alone >= {*PARAMETERS_ALONE}
