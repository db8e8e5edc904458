"""Arguments and options of several commands, and parsers of their values."""

import re
from collections.abc import Callable
from decimal import Decimal
from functools import wraps
from inspect import Parameter, signature
from math import isinf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import typer

from busplan.errors import BusplanError
from busplan.forms import ENDINGS, Form

if TYPE_CHECKING:
    from collections.abc import Mapping

    from busplan.sections.profile import Profile

AnyForm = TypeVar("AnyForm", bound=str)

_TIME: Final = re.compile(r"(?P<value>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?|\.[0-9]+)\s*(?P<unit>us|ms|s)")
MAX_BYTES: Final = 1_000_000
_SIZE: Final = r"\s*[0-9]{1,12}\s*"
_EXPONENT: Final = {"us": 0, "ms": 3, "s": 6}


def complete_profile(incomplete: str) -> list[str]:
    """Complete the name of a shipped profile for the shell."""
    from busplan.profile.shipped import shipped_names

    return [name for name in shipped_names() if name.startswith(incomplete)]


ProfileArgument = Annotated[
    str,
    typer.Argument(
        help="A profile file, the name of a shipped profile (see `busplan profiles`), or - for standard input.",
        autocompletion=complete_profile,
        show_default=False,
    ),
]
PeriodsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--period",
        metavar="TIME",
        help="Communication period with its unit, as 4ms, 250us or 0.001s. May be given several times.  "
        "[default: the profile's cycle.period_us]",
        show_default=False,
    ),
]
NodesOption = Annotated[
    int | None,
    typer.Option(
        "--nodes",
        metavar="N",
        help="Number of distributed nodes, the host not counted.  [default: the profile's bus.nodes]",
        show_default=False,
    ),
]
GapCountOption = Annotated[
    str | None,
    typer.Option(
        "--gap-count",
        metavar="0..63|optimal",
        help="Gap count of all nodes; optimal is the smallest safe one for the hops.  "
        "[default: the profile's bus.gap_count]",
        show_default=False,
    ),
]
TimingOption = Annotated[
    str,
    typer.Option(
        "--timing",
        metavar="MODEL|both",
        help="Timing model to report, or both. IEEE 1394 has paper, the paper's equations as published, and standard, "
        "the standard's clock and packets.",
    ),
]


def bus_changes(*, nodes: int | None, gap_count: str | None) -> dict[str, object]:
    """Changes of a profile by --nodes and --gap-count, by dotted key."""
    changes: dict[str, object] = {}
    if nodes is not None:
        changes["bus.nodes"] = nodes
    if gap_count is not None:
        # Other text is passed on: the profile's schema accepts or refuses it.
        changes["bus.gap_count"] = int(gap_count) if re.fullmatch(r"[+-]?[0-9]{1,9}", gap_count) else gap_count
    return changes


ALL_MODELS: Final = "both"
"""Value of --timing for all timing models."""
BUS_OPTIONS: Final = {"bus.nodes": "--nodes", "bus.gap_count": "--gap-count"}
"""Options by profile key."""


KeyChanges = dict[str, object]
"""New values of a profile by dotted key."""
NO_CHANGES: Final[KeyChanges] = {}


def takes_bus_options(command: Callable[..., None]) -> Callable[..., None]:
    """Replace the parameter `changes` of a command by the options --nodes and --gap-count, whose values it gets.

    Parameters
    ----------
    command
        A command with a parameter `changes`.
    """
    options = {"nodes": NodesOption, "gap_count": GapCountOption}
    own = signature(command)
    parameters: list[Parameter] = []
    for one in own.parameters.values():
        if one.name == "changes":
            kinds = options.items()
            parameters += [Parameter(name, one.kind, default=None, annotation=option) for name, option in kinds]
        else:
            parameters.append(one)

    @wraps(command)
    def with_changes(*arguments: Any, nodes: int | None, gap_count: str | None, **others: Any) -> None:
        command(*arguments, changes=bus_changes(nodes=nodes, gap_count=gap_count), **others)

    with_changes.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    kept = {name: one for name, one in command.__annotations__.items() if name != "changes"}
    with_changes.__annotations__ = {**kept, **options}
    return with_changes


def load_changed(argument: str, changes: KeyChanges) -> "Profile":
    """Read a profile and apply the values of options.

    Raises
    ------
    BusplanError
        Not a profile, or a value that its schema refuses.
    """
    from busplan.profile.shipped import load
    from busplan.profile.toml import override

    return override(load(argument).profile, changes, origin=BUS_OPTIONS)


def periods_us(texts: list[str] | None, profile: "Profile") -> list[float] | None:
    """Parse the values of --period, such as 4ms, 250us or 0.001s [us]; None if it is not given.

    Raises
    ------
    BusplanError
        Not a number with a unit, or out of the profile's range.
    """
    if not texts:
        return None
    from busplan.profile.toml import override

    found = []
    for text in texts:
        period_us = time_us(text, option="--period")
        override(profile, {"cycle.period_us": period_us}, origin={"cycle.period_us": f"--period {text}, in us"})
        found.append(period_us)
    return found


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
    # With Decimal, 0.0003 s is exactly 300 us.
    found_us = float(Decimal(match["value"]).scaleb(_EXPONENT[match["unit"]]))
    if isinf(found_us):
        raise BusplanError(f"{option} {text}: is longer than any time; expected one as 4ms, 250us or 0.001s")
    return found_us


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


def timing_models(timing: str, profile: "Profile") -> tuple[str, ...]:
    """Timing models of --timing.

    Raises
    ------
    BusplanError
        The profile's kind of bus has no such model.
    """
    return known_models(profile) if timing == ALL_MODELS else (timing_model(timing, profile),)


def timing_model(timing: str, profile: "Profile") -> str:
    """The timing model of --timing, for commands that take one only.

    Raises
    ------
    BusplanError
        The profile's kind of bus has no such model, or the model cannot express the profile.
    """
    from busplan.analysis.network import known_model

    return known_model(profile, timing, name="--timing")


def known_models(profile: "Profile") -> tuple[str, ...]:
    """Names of the timing models of a profile's kind of bus."""
    from busplan.analysis.network import model_names

    return model_names(profile)


def plot_format(path: Path) -> str:
    """File format of a figure, by the ending of its name.

    Raises
    ------
    BusplanError
        Another ending, or matplotlib is not installed.
    """
    from busplan.drawings.circle_plot import PLOT_FORMATS, require_matplotlib

    file_format = path.suffix.removeprefix(".").lower()
    if file_format not in PLOT_FORMATS:
        raise BusplanError(f"--plot {path}: expected a name ending in .png, .svg or .pdf")
    require_matplotlib()
    return file_format


STANDARD_OUTPUT: Final = Path("-")


def output_option(words: str) -> Any:
    """Make the option --output.

    Parameters
    ----------
    words
        Beginning of the help: what is written where.
    """
    help_ = f"{words}; an old file is replaced; - is standard output.  [default: standard output]"
    return typer.Option("--output", "-o", metavar="FILE", parser=_file_unless_dash, help=help_, show_default=False)


def _file_unless_dash(text: str) -> Path | None:
    return None if text == "-" else Path(text)


def format_option(default: str) -> Any:
    """Make the option --format.

    Parameters
    ----------
    default
        The form without --format and --output.
    """
    help_ = f"Form of the answer; a table is lines of text.  [default: by the ending of --output, else {default}]"
    return typer.Option("--format", help=help_, show_default=False)


FormatOption = Annotated[Form | None, format_option("table")]
OutputOption = Annotated[Path | None, output_option(f"Write the answer to FILE{', '.join(ENDINGS)}")]


def form_of_file(
    given: AnyForm | None, output: Path | None, *, forms: "Mapping[str, AnyForm]", default: AnyForm
) -> AnyForm:
    """Choose the form of a document: by --format, else by the ending of --output, else the default.

    Raises
    ------
    BusplanError
        The ending is not known.
    """
    chosen = given or (default if output is None else forms.get(output.suffix.lower()))
    if chosen is None:
        raise BusplanError(f"--output {output}: expected a name ending in {', '.join(forms)}, or --format")
    return chosen
