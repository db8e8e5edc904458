"""Arguments and options of several commands, and parsers of their values."""

import re
from collections.abc import Mapping
from math import isinf
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, TypeVar

import typer

from busplan.errors import BusplanError
from busplan.files import EMPTY_PATH
from busplan.forms import ENDINGS, PICTURES, Form, Picture, ending_expected
from busplan.profile.changes import in_unit

AnyForm = TypeVar("AnyForm", bound=str)

_TIME: Final = re.compile(r"(?P<value>[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]{1,3})?|\.[0-9]+)\s*(?P<unit>us|ms|s)")
MAX_BYTES: Final = 1_000_000
_SIZE: Final = r"\s*[0-9]{1,12}\s*"


def complete_profile(incomplete: str) -> list[str]:
    """Complete the name of a shipped profile for the shell."""
    from busplan.profile.sources import shipped_names

    return [name for name in shipped_names() if name.startswith(incomplete)]


def complete_kind(incomplete: str) -> list[str]:
    """Complete the name of a kind of bus for the shell."""
    from busplan.buses import kind_names

    return [name for name in kind_names() if name.startswith(incomplete)]


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
        help="Timing model whose figures are shown (by capacity with --all, in CSV and in JSON), by its name, or "
        "both; the verdict is always by the model that decides. IEEE 1394 has paper, the paper's equations as "
        "published, and standard, with the standard's clock and packets; other kinds have their own.",
    ),
]


ALL_MODELS: Final = "both"
"""Value of --timing-model for all timing models."""


def time_us(text: str, *, option: str) -> float:
    """Parse a time with its unit, such as 4ms, 250us or 0.001s [us].

    BusplanError: not a number with a unit, or too large for a float.
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

    BusplanError: not whole numbers above zero.
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


STANDARD_OUTPUT: Final = Path("-")


def output_option(words: str) -> Any:
    """The option --output, by the beginning of its help: what is written where."""
    return typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help=f"{words}; an old file is replaced; - is standard output.  [default: standard output]",
        parser=_file_unless_dash,
    )


def _file_unless_dash(text: str) -> Path | None:
    return None if text == "-" else path_typed(text)


def path_typed(text: str) -> Path:
    """Value of an option that is a path; typer names the option of one that is refused."""
    if not text:
        raise ValueError(EMPTY_PATH)
    return Path(text)


def format_option(default: str, *, more: str = "") -> Any:
    """The option --format, by the form without --format and --output, and what its help says of further forms."""
    return typer.Option(
        "--format",
        help=f"Form of the answer; a table is plain text.{more}  [default: by the ending of --output, else {default}]",
    )


AllOption = Annotated[
    bool, typer.Option("--all", help="Show everything: every row, and every column on a narrow terminal, too.")
]
NoPagerOption = Annotated[
    bool, typer.Option("--no-pager", help="Open no pager ($PAGER) where an answer is longer than the terminal.")
]
FormatOption = Annotated[Form | None, format_option("table")]
ChannelOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Channel of a CAN log.  [default: the only one]")
]
JobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs",
        "-j",
        metavar="N",
        min=1,
        help="Number of processes for --circle.  [default: one for each processor]",
    ),
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

    BusplanError: the ending is not known.
    """
    ending = "" if output is None else output.suffix.lower()
    chosen = given or (default if output is None else forms.get(ending))
    if chosen is None:
        raise BusplanError(f"--output {output}: {ending_expected(ending, forms, otherwise=', or --format')}")
    return chosen


def form_typed(form: str | None, output: Path | None) -> str:
    """The option that chose a form, as typed."""
    return f"--output {output}" if form is None else f"--format {form}"


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
            raise BusplanError(f"{name}: needs {company}")


VALUES_HELP: Final = (
    "250,500,1000 (with or without a unit, as 1ms) or a range A:B (in steps of 1), A:B:STEP, A:B:*FACTOR, A:B:#COUNT "
    "(evenly, both ends). Words that the key takes, as optimal, may be among the values."
)


def parse_axes(texts: list[str]) -> dict[str, str]:
    """Parse all --vary options, in order: the text of the values by key.

    BusplanError: no option, a repeated key, or not KEY=VALUES.
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
