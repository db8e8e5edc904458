"""Options that change the profile of a command: --set, and --period with its unit."""

from collections.abc import Callable, Iterable
from functools import wraps
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Annotated, Any, Final

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
        help="Communication period with its unit, as 4ms, 250us or 0.001s, or several with commas.  [default: the "
        "profile's cycle.period_us]",
        show_default=False,
    ),
]


def _period_option(words: str) -> Any:
    option = typer.Option("--period", metavar="TIME", help=f"Communication period{words}", show_default=False)
    return Annotated[str | None, option]


def _period_change(text: str) -> KeyChange:
    period_us = time_us(text, option="--period")
    return KeyChange(_PERIOD, period_us, "--period", text, f", in us {period_us}")


def _set_option(words: str) -> Any:
    help_ = (
        "Compute with another value of a key of the profile, as cycle.nonperiodic_us=50, bus.speed=S200 or "
        "node.execution.time_us=[30,40]. VALUE is TOML, a number without its unit, and is checked like the file; a "
        f"table replaces the whole section. May be given several times.{words and ' '}{words}  [default: the profile "
        "as it is]"
    )
    option = typer.Option(SET, metavar="KEY=VALUE", help=help_, show_default=False)
    return Annotated[list[str] | None, option]


def takes_changes(words: str = "", *, period: str = "") -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Replace the parameter `changes` of a command by --set, and by --period where that sets the profile's period.

    Parameters
    ----------
    words
        End of the help of --set: what is special here.
    period
        End of the help of --period, with the default; empty where the command has none, or its own.
    """
    options = {**({"period": _period_option(period)} if period else {}), "set_": _set_option(words)}

    def replaced(command: Callable[..., None]) -> Callable[..., None]:
        own = signature(command)
        parameters: list[Parameter] = []
        for parameter in own.parameters.values():
            if parameter.name == "changes":
                kinds = options.items()
                parameters += [
                    Parameter(name, parameter.kind, default=None, annotation=option) for name, option in kinds
                ]
            else:
                parameters.append(parameter)

        @wraps(command)
        def with_changes(*arguments: Any, set_: list[str] | None, **others: Any) -> None:
            text = others.pop("period") if period else None
            made = () if text is None else (_period_change(text),)
            changes = KeyChanges((*made, *parse_set(set_ or ())))
            for computed in others.get("period") or ():
                _require_no_period(changes, computed)
            command(*arguments, changes=changes, **others)

        # Typer reads the options of a command from its signature; without it every command would list these two.
        with_changes.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        kept = {name: annotation for name, annotation in command.__annotations__.items() if name != "changes"}
        with_changes.__annotations__ = {**kept, **options}
        return with_changes

    return replaced


def _require_no_period(changes: KeyChanges, text: str) -> None:
    """Refuse periods to compute, such as 4ms, beside a change of the period."""
    for change in changes.each:
        if change.key == _PERIOD:
            require_separate(change, _PERIOD, typed=f"--period {text}")


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


def load_each(arguments: Iterable[str], load: "Callable[[str], Profile]") -> "list[Profile]":
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
    asked = list(arguments)
    if asked.count("-") > 1:
        raise BusplanError("-: standard input can be read once; give files for the others")
    for argument in asked:
        try:
            profiles.append(load(argument))
        except BusplanError as error:
            problems.extend(error.problems)
    if problems:
        raise BusplanError(*dict.fromkeys(problems))
    return profiles
