"""Arguments and options of several commands, and parsers of their values."""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from inspect import Parameter, signature
from itertools import product
from math import isinf
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypeVar

import typer

from busplan.errors import BusplanError
from busplan.extras import require_resvg
from busplan.forms import ENDINGS, PICTURES, Form, Picture, ending_expected
from busplan.profile.changes import SET, KeyChange, KeyChanges, in_unit, parse_set, require_separate

if TYPE_CHECKING:
    from busplan.sections.profile import Profile


AnyForm = TypeVar("AnyForm", bound=str)

_TIME: Final = re.compile(r"(?P<value>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?|\.[0-9]+)\s*(?P<unit>us|ms|s)")
MAX_BYTES: Final = 1_000_000
_SIZE: Final = r"\s*[0-9]{1,12}\s*"


def complete_profile(incomplete: str) -> list[str]:
    """Complete the name of a shipped profile for the shell."""
    from busplan.profile.sources import shipped_names

    return [name for name in shipped_names() if name.startswith(incomplete)]


ProfileArgument = Annotated[
    str,
    typer.Argument(
        help="A profile file, the name of a shipped profile (see `busplan profiles`), or - for standard input.",
        autocompletion=complete_profile,
        show_default=False,
    ),
]
TimingModelOption = Annotated[
    str,
    typer.Option(
        "--timing-model",
        metavar="MODEL|both",
        help="Timing model to report, by its name, or both. IEEE 1394 has paper, the paper's equations as published, "
        "and standard, with the standard's clock and packets; other kinds have their own.",
    ),
]


ALL_MODELS: Final = "both"
"""Value of --timing-model for all timing models."""


def time_us(text: str, *, option: str) -> float:
    """Parse a time with its unit, such as 4ms, 250us or 0.001s [us].

    Raises
    ------
    BusplanError
        Not a number with a unit, or too large for a float.
    """
    match = _TIME.fullmatch(text.strip())
    if match is None:
        raise BusplanError(f"{option} {text}: expected a time with its unit, as 4ms, 250us or 0.001s")
    duration_us = in_unit(match["value"], match["unit"], "us") or 0.0
    if isinf(duration_us):
        raise BusplanError(f"{option} {text}: is too long; expected a time with its unit, as 4ms, 250us or 0.001s")
    return duration_us


def parse_sizes(text: str, *, option: str) -> list[int]:
    """Parse sizes separated by commas, such as 4,16,32 [bytes].

    Raises
    ------
    BusplanError
        Not whole numbers above zero.
    """
    sizes = []
    for part in text.split(","):
        if not re.fullmatch(_SIZE, part) or not 1 <= int(part) <= MAX_BYTES:
            raise BusplanError(
                f"{option} {text}: expected payloads of 1 to {MAX_BYTES:,} bytes between commas, as 4,16,32"
            )
        sizes.append(int(part))
    return sizes


def chosen_model(timing_model: str | None) -> str | None:
    """The argument of a question for --timing-model; None for all."""
    return None if timing_model == ALL_MODELS else timing_model


def option(usage: str, words: str, **settings: Any) -> Any:
    """Make an option whose help states the default: in the code it is None, or False.

    Parameters
    ----------
    usage
        Names and value as in the help: "--output,-o FILE".
    words
        Text of its help, with the default in brackets at the end.
    settings
        Further settings of typer's option.
    """
    names, _, value = usage.partition(" ")
    return typer.Option(*names.split(","), metavar=value or None, help=words, **{"show_default": False, **settings})


STANDARD_OUTPUT: Final = Path("-")


def output_option(words: str) -> Any:
    """Make the option --output.

    Parameters
    ----------
    words
        Beginning of its help: what is written where.
    """
    help_ = f"{words}; an old file is replaced; - is standard output.  [default: standard output]"
    return option("--output,-o FILE", help_, parser=_file_unless_dash)


def _file_unless_dash(text: str) -> Path | None:
    return None if text == "-" else Path(text)


def format_option(default: str, *, more: str = "") -> Any:
    """Make the option --format.

    Parameters
    ----------
    default
        The form without --format and --output.
    more
        What its help says of further forms.
    """
    help_ = f"Form of the answer; a table is plain text.{more}  [default: by the ending of --output, else {default}]"
    return option("--format", help_)


AllOption = Annotated[bool, option("--all", "Show everything: every row, and every column on a narrow terminal, too.")]
FormatOption = Annotated[Form | None, format_option("table")]
JobsOption = Annotated[
    int | None, option("--jobs,-j N", "Number of processes for --circle.  [default: one for each processor]", min=1)
]
OutputOption = Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(ENDINGS)}")]
DrawnForm = Literal[Form, Picture]
"""Form of an answer that may also be a picture."""
DRAWN_ENDINGS: Final[Mapping[str, DrawnForm]] = MappingProxyType({**ENDINGS, **PICTURES})
DrawnFormatOption = Annotated[
    DrawnForm | None,
    format_option("table", more=" png goes to a file or a pipe, and needs the extra plot (resvg-py)."),
]
DrawnOutputOption = Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(DRAWN_ENDINGS)}")]


def form_of_file(
    given: AnyForm | None, output: Path | None, *, forms: Mapping[str, AnyForm], default: AnyForm
) -> AnyForm:
    """Choose the form of a document: by --format, else by the ending of --output, else the default.

    Raises
    ------
    BusplanError
        The ending is not known.
    """
    ending = "" if output is None else output.suffix.lower()
    chosen = given or (default if output is None else forms.get(ending))
    if chosen is None:
        raise BusplanError(f"--output {output}: {ending_expected(ending, forms, otherwise=', or --format')}")
    return chosen


def plot_form(path: Path) -> Picture:
    """Form of the picture of --plot, by the ending of its name.

    Raises
    ------
    BusplanError
        The ending is not known, or the form is png and resvg-py is missing.
    """
    ending = path.suffix.lower()
    if ending not in PICTURES:
        raise BusplanError(f"--plot {path}: {ending_expected(ending, PICTURES)}")
    if ending == ".png":
        require_resvg("--plot")
    return PICTURES[ending]


def require_company(company: str, options: Mapping[str, object], *, is_given: object) -> None:
    """Refuse options that go with another option.

    Parameters
    ----------
    company
        The other option, as in its help.
    options
        Value by option; an empty value is an option that is not given.
    is_given
        Whether the other option is given.

    Raises
    ------
    BusplanError
        An option without its company.
    """
    for name, value in options.items():
        if value and not is_given:
            raise BusplanError(f"{name}: goes with {company}")


VALUES_HELP: Final = (
    "250,500,1000 or a range A:B (in steps of 1), A:B:STEP, A:B:*FACTOR, A:B:#COUNT (evenly, both ends). Words that "
    "the key takes, as optimal, may be among the values."
)


def parse_axes(texts: list[str]) -> dict[str, str]:
    """Parse all --vary options, in order: the text of the values by key.

    Raises
    ------
    BusplanError
        No option, a repeated key, or not KEY=VALUES.
    """
    if not texts:
        raise BusplanError("--vary: nothing to vary; give a key of the profile and its values, as bus.nodes=1:62")
    axes: dict[str, str] = {}
    for text in texts:
        key, values = parse_axis(text, option="--vary")
        if key in axes:
            raise BusplanError(f"--vary {text}: {key} is varied already; give all its values at once")
        axes[key] = values
    return axes


def parse_axis(text: str, *, option: str) -> tuple[str, str]:
    """Parse one KEY=VALUES: the key, and the text of its values.

    Parameters
    ----------
    text
        Value of the option.
    option
        Name of the option.

    Raises
    ------
    BusplanError
        Not KEY=VALUES.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not key or not values:
        raise BusplanError(f"{option} {text}: expected KEY=VALUES, as bus.nodes=1:62 or cycle.period_us=250,500,1000")
    return key, values


_PERIOD: Final = "cycle.period_us"
PeriodsOption = Annotated[
    list[str] | None,
    option(
        "--period TIME[,TIME...]",
        "Communication period with its unit, as 4ms, 250us or 0.001s, or several with commas.  [default: the "
        "profile's cycle.period_us]",
    ),
]
_TakenPeriod = Annotated[
    str | None,
    option(
        "--period TIME",
        "Communication period with its unit, as 4ms, 250us or 0.001s.  [default: the profile's cycle.period_us]",
    ),
]


def _period_change(text: str) -> KeyChange:
    period_us = time_us(text, option="--period")
    return KeyChange(_PERIOD, period_us, "--period", text, f", in us {period_us}")


def _set_option(words: str) -> Any:
    usage = (
        "Compute with another value of a key of the profile, as cycle.nonperiodic_us=50, bus.speed=S200 or "
        "node.execution.time_us=[30,40]. VALUE is TOML, a number in the unit of its key or with one, as 250us; it is "
        "checked like the file; a table replaces the whole section. May be given several times."
        f"{words and ' '}{words}  [default: the profile as it is]"
    )
    return Annotated[list[str] | None, option(f"{SET} KEY=VALUE", usage)]


def takes_changes(words: str = "", *, period: bool = False) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace the parameter `changes` of a command by --set, and by --period where that sets the profile's period.

    Parameters
    ----------
    words
        End of the help of --set: what is special here.
    period
        Whether --period sets the profile's period; a command may have its own, for several.
    """
    options = {**({"period": _TakenPeriod} if period else {}), "set_": _set_option(words)}

    def replaced(command: Callable[..., None]) -> Callable[..., None]:
        written = signature(command)
        parameters: list[Parameter] = []
        for parameter in written.parameters.values():
            if parameter.name == "changes":
                for name, annotation in options.items():
                    parameters.append(Parameter(name, parameter.kind, default=None, annotation=annotation))
            else:
                parameters.append(parameter)

        @wraps(command)
        def with_changes(*arguments: Any, set_: list[str] | None, **given: Any) -> None:
            text = given.pop("period") if period else None
            made = () if text is None else (_period_change(text),)
            changes = KeyChanges((*made, *parse_set(set_ or ())))
            # Periods to compute, such as 4ms, beside a change of the period.
            for computed, change in product(given.get("period") or (), changes.entries):
                if change.key == _PERIOD:
                    require_separate(change, _PERIOD, typed=f"--period {computed}")
            from busplan.sourced import constants_changed

            with constants_changed(changes.changed_constants):
                command(*arguments, changes=changes, **given)

        # Typer reads the options of a command from its signature; without it every command would list these two.
        with_changes.__signature__ = written.replace(parameters=parameters)  # type: ignore[attr-defined]
        kept = {name: annotation for name, annotation in command.__annotations__.items() if name != "changes"}
        with_changes.__annotations__ = {**kept, **options}
        return with_changes

    return replaced


def load_changed(argument: str, changes: KeyChanges) -> "Profile":
    """Read a profile and apply the values of options.

    Raises
    ------
    BusplanError
        Not a profile, or a value that its schema refuses.
    """
    from busplan.profile.sources import load

    return changes.applied(load(argument).profile)


def periods_us(texts: list[str] | None, profile: "Profile") -> list[float] | None:
    """Parse the values of --period, such as 4ms, 250us or 0.001s [us]; None if it is not given.

    Raises
    ------
    BusplanError
        Not a number with a unit, or out of the profile's range.
    """
    if not texts:
        return None
    made = [change for text in texts for change in _period_changes(text)]
    for change in made:
        KeyChanges((change,)).applied(profile)
    return [time_us(change.text, option="--period") for change in made]


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

    Parameters
    ----------
    arguments
        PROFILE arguments; standard input may be one of them.
    load
        Function that reads one.

    Raises
    ------
    BusplanError
        Standard input more than once; or the problems of all profiles together.
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
