"""Options that change the profile of a command: --set and its short forms."""

import re
from collections.abc import Callable
from decimal import Decimal
from functools import wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer

from busplan.cli.options import time_us
from busplan.errors import BusplanError
from busplan.profile.changes import SET, KeyChange, KeyChanges, parse_set, require_separate

if TYPE_CHECKING:
    from busplan.sections.profile import Profile

_PERIOD: Final = "cycle.period_us"
PeriodsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--period",
        metavar="TIME[,TIME...]",
        help="Communication period with its unit, as 4ms, 250us or 0.001s, or several between commas.  "
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
        help="Gap count of all nodes of an IEEE 1394 bus; optimal is the smallest safe one for the hops.  "
        "[default: the profile's bus.gap_count]",
        show_default=False,
    ),
]
ReserveOption = Annotated[
    str | None,
    typer.Option(
        "--reserve",
        metavar="SHARE",
        help="Share of the slice that must stay free, as 20% or 0.2.  [default: the profile's limits.reserve]",
        show_default=False,
    ),
]


class ShortForm(NamedTuple):
    """An option that sets one key of a profile."""

    option: str
    key: str
    annotation: Any
    """Its parameter for typer."""
    parse: Callable[[Any], tuple[object, str]] = lambda value: (value, "")
    """Function from what typer gives to the key's value and `KeyChange.note`."""

    @property
    def parameter(self) -> str:
        """Name of the parameter."""
        return self.option.removeprefix("--").replace("-", "_")

    def change(self, given: object) -> KeyChange:
        """The change that the option makes."""
        value, note = self.parse(given)
        return KeyChange(self.key, value, self.option, str(given), note)


def _gap_count(text: str) -> tuple[object, str]:
    # Other text is passed on: the profile's schema accepts or refuses it.
    return int(text) if re.fullmatch(r"[+-]?[0-9]{1,9}", text) else text, ""


def _period(text: str) -> tuple[float, str]:
    period_us = time_us(text, option="--period")
    return period_us, f", in us {period_us}"


def period_form(words: str) -> ShortForm:
    """Make the option --period of a command that takes one.

    Parameters
    ----------
    words
        End of the help, with the default.
    """
    help_ = f"Communication period{words}"
    option = typer.Option("--period", metavar="TIME", help=help_, show_default=False)
    return ShortForm("--period", _PERIOD, Annotated[str | None, option], _period)


def _share(text: str) -> tuple[object, str]:
    """Read 20% or 0.2. Other text is passed on: the profile's schema refuses it."""
    match = re.fullmatch(r"([0-9]{1,9}(?:\.[0-9]{1,9})?)(%?)", text.strip())
    if match is None:
        return text, ""
    share = float(Decimal(match[1]) / (100 if match[2] else 1))
    return share, f", as a share {share}"


NODES: Final = ShortForm("--nodes", "bus.nodes", NodesOption)
GAP_COUNT: Final = ShortForm("--gap-count", "bus.gap_count", GapCountOption, _gap_count)
RESERVE: Final = ShortForm("--reserve", "limits.reserve", ReserveOption, _share)


def _set_option(words: str) -> Any:
    help_ = (
        "Compute with another value of a key of the profile, as cycle.nonperiodic_us=50, bus.speed=S200 or "
        "node.execution.time_us=[30,40]. VALUE is TOML, a number without its unit, and is checked as in the file; "
        f"a table replaces the section. May be given several times.{words and ' '}{words}  "
        "[default: the profile as it is]"
    )
    option = typer.Option(SET, metavar="KEY=VALUE", help=help_, show_default=False)
    return Annotated[list[str] | None, option]


def takes_changes(*short_forms: ShortForm, words: str = "") -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace the parameter `changes` of a command by --set and its short forms, whose values it gets.

    Parameters
    ----------
    short_forms
        The short forms that the command has.
    words
        End of the help of --set: what is special here.
    """
    options = {**{one.parameter: one.annotation for one in short_forms}, "set_": _set_option(words)}

    def replaced(command: Callable[..., None]) -> Callable[..., None]:
        own = signature(command)
        parameters: list[Parameter] = []
        for one in own.parameters.values():
            if one.name == "changes":
                kinds = options.items()
                parameters += [Parameter(name, one.kind, default=None, annotation=option) for name, option in kinds]
            else:
                parameters.append(one)

        @wraps(command)
        def with_changes(*arguments: Any, set_: list[str] | None, **others: Any) -> None:
            given = ((one, others.pop(one.parameter)) for one in short_forms)
            made = [one.change(value) for one, value in given if value is not None]
            changes = KeyChanges((*made, *parse_set(set_ or ())))
            for text in others.get("period") or ():
                _require_no_period(changes, text)
            command(*arguments, changes=changes, **others)

        with_changes.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        kept = {name: one for name, one in command.__annotations__.items() if name != "changes"}
        with_changes.__annotations__ = {**kept, **options}
        return with_changes

    return replaced


def _require_no_period(changes: KeyChanges, text: str) -> None:
    """Refuse periods to compute, such as 4ms, beside a change of the period."""
    for one in changes.each:
        if one.key == _PERIOD:
            require_separate(one, _PERIOD, typed=f"--period {text}")


def load_changed(argument: str, changes: KeyChanges) -> "Profile":
    """Read a profile and apply the values of options.

    Raises
    ------
    BusplanError
        Not a profile, or a value that its schema refuses.
    """
    from busplan.profile.shipped import load

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
    found = []
    for text, (period_us, note) in (one for several in texts for one in _periods(several)):
        KeyChanges((KeyChange(_PERIOD, period_us, "--period", text, note),)).applied(profile)
        found.append(period_us)
    return found


def _periods(text: str) -> list[tuple[str, tuple[float, str]]]:
    """Each period between commas, as typed and as a value."""
    parts = text.split(",")
    try:
        return [(part, _period(part)) for part in parts]
    except BusplanError:
        if len(parts) == 1:
            raise
        raise BusplanError(f"--period {text}: expected times with their unit between commas, as 500us,1ms") from None
