"""Options and arguments that all commands share, declared and handled once: PROFILE, --set, --period, --all, --format.

A command is a function that takes a `Call` and returns its answer; `command` makes it what typer calls.
"""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cached_property, wraps
from inspect import Parameter, Signature, signature
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, TypeAlias, get_args

import typer
from typer.models import OptionInfo

from busplan.cli.answering import answer, profile_files
from busplan.cli.options import (
    DRAWN_ENDINGS,
    AllOption,
    DrawnForm,
    DrawnFormatOption,
    DrawnOutputOption,
    NoPagerOption,
    OutputOption,
    ProfileArgument,
    form_of_file,
    form_typed,
    format_option,
    path_typed,
    time_us,
)
from busplan.cli.output import PAGER, PlanFailsError, say
from busplan.errors import ArgumentError, BusplanError
from busplan.forms import ENDINGS, Form
from busplan.profile.changes import NO_CHANGES, SET, KeyChange, KeyChanges, parse_set, require_separate

if TYPE_CHECKING:
    from busplan.forms.blocks import Report
    from busplan.profile.document import LoadedProfile
    from busplan.questions.base.answer import Answer
    from busplan.sections.profile import Profile

Command: TypeAlias = Callable[..., Any]
Periods: TypeAlias = Literal["one", "several"]
_PERIOD: Final = "cycle.period_us"
_PERIOD_HELP: Final = "Communication period with its unit, as 4ms, 250us or 0.001s"
_PERIOD_DEFAULT: Final = ".  [default: the profile's cycle.period_us]"
_PERIODS: Final[Mapping[Periods, Any]] = MappingProxyType(
    {
        "one": Annotated[str | None, typer.Option("--period", metavar="TIME", help=f"{_PERIOD_HELP}{_PERIOD_DEFAULT}")],
        "several": Annotated[
            list[str] | None,
            typer.Option(
                "--period",
                metavar="TIME[,TIME...]",
                help=f"{_PERIOD_HELP}, or several with commas, as 4ms,500us{_PERIOD_DEFAULT}",
            ),
        ],
    }
)
_SET_HELP: Final = (
    "Compute with another value of a key of the profile, as cycle.nonperiodic_us=50, bus.speed=S200 or "
    "node.execution.time_us=[30,40]. VALUE is TOML, a number in the unit of its key or with one, as 250us; it is "
    "checked like the file; a table replaces the whole section. May be given several times."
)


@dataclass(frozen=True)
class Call:
    """The arguments and options of a command that all questions share."""

    argument: str = ""
    """PROFILE; empty for a command that has none, or names its profiles itself."""
    changes: KeyChanges = NO_CHANGES
    """Values of --set, and of a --period that changes the profile."""
    periods: tuple[str, ...] = ()
    """Values of a --period that lists periods to compute."""
    form: DrawnForm = "table"
    form_typed: str = ""
    """The option that chose the form, as typed."""
    output: Path | None = None

    @cached_property
    def loaded(self) -> "LoadedProfile":
        """The profile as its file has it, read at its first use."""
        from busplan.profile.sources import load

        return load(self.argument)

    @cached_property
    def profile(self) -> "Profile":
        """The profile with the changes."""
        return self.changes.applied(self.loaded.profile)

    @property
    def periods_us(self) -> list[float] | None:
        """Periods to compute, in the range of the profile's schema [us]; None for that of the profile."""
        made = [change for text in self.periods for change in _period_changes(text)]
        for change in made:
            KeyChanges((change,)).applied(self.profile)
        return [time_us(change.text, option="--period") for change in made] or None


class Fails(NamedTuple):
    """An answer by which the plan fails: it is written, and the command exits with 1."""

    answer: "Answer | Report"
    words: str = ""
    """Said on standard error."""


def command(
    words: str = "",
    *,
    of: Literal["profile", "profiles", "nothing"] = "profile",
    period: Periods | None = None,
    answers: bool = True,
    reads: Callable[..., Iterable[Path]] = lambda **_: (),
    is_drawn: bool = False,
    has_all: bool = True,
    default: Form = "table",
    names_changes: bool = False,
) -> Callable[[Command], Command]:
    """Give a function the options that commands share, and write the answer that it returns.

    A parameter of the function that is a dataclass is a record of options: each field is an option.

    Parameters
    ----------
    words
        End of the help of --set: what is special here.
    of
        Whether there is PROFILE with --set, --set alone for profiles that the function names itself, or neither.
    period
        Whether --period changes the profile's period or lists periods to compute; None for no --period.
    answers
        Whether the function returns an answer, or `Fails` with one; if not, it has written all itself.
    reads
        Files that the function reads beside PROFILE, from its own options.
    is_drawn
        Whether the answer may also be a picture.
    has_all
        Whether there is --all.
    default
        Form on standard output without --format.
    names_changes
        Whether the answer itself names the changes by --set.
    """
    set_help = f"{' '.join(filter(None, (_SET_HELP, words)))}  [default: the profile as it is]"
    set_option = Annotated[list[str] | None, typer.Option(SET, metavar="KEY=VALUE", help=set_help)]
    form = DrawnFormatOption if is_drawn else Annotated[Form | None, format_option(default)]
    before = {
        **({"profile": ProfileArgument} if of == "profile" else {}),
        **({"period": _PERIODS[period]} if period else {}),
        **({"set_": set_option} if of != "nothing" else {}),
    }
    after = {
        **({"all_": AllOption} if answers and has_all else {}),
        **({"format_": form, "output": DrawnOutputOption if is_drawn else OutputOption} if answers else {}),
        "no_pager": NoPagerOption,
    }

    def declared(function: Command) -> Command:
        takes, records, own = _parameters(function)

        def asked_of(**given: Any) -> Any:
            try:
                return function(**given)
            except ArgumentError as error:
                raise error.typed(filter(None, map(_option, parameters))) from None

        @wraps(function)
        def run(**given: Any) -> None:
            asked = {name: given.pop(name) for name in (*before, *after)}
            if asked["no_pager"]:
                os.environ[PAGER] = ""
            for name, (record, fields) in records.items():
                given[name] = record(**{field: given.pop(field) for field in fields})
            call = _call(asked, forms=DRAWN_ENDINGS if is_drawn else ENDINGS, default=default)
            if takes:
                given["call"] = call
            from busplan.sourced import constants_changed

            with constants_changed(call.changes.changed_constants):
                if not answers:
                    asked_of(**given)
                    return
                with answer(
                    call.form,
                    call.output,
                    typed=call.form_typed,
                    inputs=(*(profile_files(call.argument) if call.argument else ()), *reads(**given)),
                    changes=NO_CHANGES if names_changes else call.changes,
                    is_whole=asked.get("all_", False),
                ) as give:
                    result = asked_of(**given)
                    give(result.answer if isinstance(result, Fails) else result)
            if isinstance(result, Fails):
                say(*filter(None, (result.words,)))
                raise PlanFailsError

        parameters = [*_keywords(before), *own, *_keywords(after)]
        # Typer reads the signature, and the annotations beside it.
        run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return declared


def _parameters(function: Command) -> tuple[bool, dict[str, tuple[type, list[str]]], list[Parameter]]:
    """Whether a function takes a `Call`; its records with their fields; and its own parameters, fields included."""
    takes, records, own = False, {}, []
    for each in signature(function).parameters.values():
        if each.annotation is Call:
            takes = True
        elif isinstance(each.annotation, type) and is_dataclass(each.annotation):
            fields = signature(each.annotation).parameters
            records[each.name] = each.annotation, list(fields)
            for field in fields.values():
                # Its options are a section of the help.
                _, info = get_args(field.annotation)
                info.rich_help_panel = (each.annotation.__doc__ or "").rstrip(".")
                own.append(field)
        else:
            own.append(each)
    for each in own:
        annotation, info = get_args(each.annotation)
        if Path in (annotation, *get_args(annotation)) and info.parser is None:
            info.parser = path_typed
    return takes, records, [each.replace(kind=Parameter.KEYWORD_ONLY) for each in own]


def _option(parameter: Parameter) -> str:
    """Option of a parameter as typed; empty for an argument without an option."""
    _, info = get_args(parameter.annotation)
    if not isinstance(info, OptionInfo):
        return ""
    return max(info.param_decls or (f"--{parameter.name.replace('_', '-')}",), key=len)


def _keywords(options: Mapping[str, Any]) -> Iterator[Parameter]:
    defaults = {"profile": Parameter.empty, "all_": False, "no_pager": False}
    for name, annotation in options.items():
        yield Parameter(name, Parameter.KEYWORD_ONLY, default=defaults.get(name), annotation=annotation)


def _call(asked: Mapping[str, Any], *, forms: Mapping[str, DrawnForm], default: Form) -> Call:
    """The values of shared options."""
    period, form, output = asked.get("period"), asked.get("format_"), asked.get("output")
    one, several = ((period,), ()) if isinstance(period, str) else ((), tuple(period or ()))
    changes = KeyChanges((*map(_period_change, one), *parse_set(asked.get("set_") or ())))
    for computed, change in product(several, changes.entries):
        if change.key == _PERIOD:
            require_separate(change, _PERIOD, typed=f"--period {computed}")
    return Call(
        argument=asked.get("profile", ""),
        changes=changes,
        periods=several,
        form=form_of_file(form, output, forms=forms, default=default),
        form_typed=form_typed(form, output),
        output=output,
    )


def _period_change(text: str) -> KeyChange:
    period_us = time_us(text, option="--period")
    return KeyChange(_PERIOD, period_us, "--period", text, f", in us {period_us}")


def _period_changes(text: str) -> list[KeyChange]:
    """A change for each period between commas."""
    parts = text.split(",")
    try:
        return [_period_change(part) for part in parts]
    except BusplanError:
        if len(parts) == 1:
            raise
        raise BusplanError(f"--period {text}: expected times with their unit between commas, as 500us,1ms") from None


def load_each(arguments: Sequence[str], load: "Callable[[str], Profile]") -> "list[Profile]":
    """Read every profile.

    BusplanError: standard input more than once; or the problems of all profiles together.
    """
    profiles: list[Profile] = []
    problems: list[str] = []
    if arguments.count("-") > 1:
        raise BusplanError("-: standard input can be read once; give files for the others")
    for argument in arguments:
        try:
            profiles.append(load(argument))
        except BusplanError as error:
            problems.extend(error.problems)
    if problems:
        raise BusplanError(*dict.fromkeys(problems))
    return profiles
