"""Arguments of the Python interface: profiles, and values as lists, ranges or NumPy arrays, all checked."""

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar, cast

from busplan.buses.network import Network
from busplan.english import listed
from busplan.errors import ArgumentError, BusplanError
from busplan.files import given_path
from busplan.profile.changes import NO_CHANGES, KeyChange, KeyChanges
from busplan.profile.document import override
from busplan.profile.edit import value_text
from busplan.profile.kinds import dotted_keys
from busplan.profile.sources import load, shipped_names
from busplan.questions.fit.network import model_names, network_of
from busplan.sections.base import MAX_COUNT
from busplan.sections.profile import Profile
from busplan.sourced import constants_changed

FilePath = str | os.PathLike[str]
"""A path. A str may also be the name of a shipped profile; a path object is always a path."""
ProfileLike = Profile | FilePath
Periods = float | Iterable[float]
"""A communication period [us], or several."""
Models = str | Iterable[str]
"""The name of a timing model, or several."""
MOST_FLOAT: Final = sys.float_info.max

_Item = TypeVar("_Item")
_Parameters = ParamSpec("_Parameters")
_Answer = TypeVar("_Answer")


def load_profile(profile: ProfileLike, *, changes: Mapping[str, object] | None = None) -> Profile:
    """Read and check a profile, and change some of its values.

    Parameters
    ----------
    profile
        A path, the name of a shipped profile, or a `Profile`. A str that is a shipped name means the shipped profile;
        "./paper-4ms" and path objects are always files.
    changes
        New values by dotted key, in the key's unit: {"bus.nodes": 3, "cycle.period_us": 500}. They are checked like a
        file; the file is not changed. {"constants.ARBITRATION_HOLD_US": 2} changes a constant of its bus, with which
        all answers for this profile are computed.

    Returns
    -------
    Profile
        Frozen, with a typed attribute for every key: `profile.cycle.period_us` [us].

    Raises
    ------
    BusplanError
        The file does not exist, cannot be read or is not a valid profile, with the place of every problem; or the
        profile's schema refuses a change.

    Examples
    --------
    >>> import busplan
    >>> busplan.load_profile("paper-4ms").cycle.period_us
    4000.0
    >>> busplan.load_profile("paper-4ms", changes={"bus.nodes": 3, "cycle.nonperiodic_us": 2}).bus.nodes
    3
    """
    new = values_by_key(changes, name="changes")
    loaded = profile if isinstance(profile, Profile) else load(argument(profile)).profile
    return override(loaded, new)


def with_its_constants(
    question: Callable[_Parameters, _Answer],
) -> Callable[_Parameters, _Answer]:
    """Decorator of a question that loads the profile and computes with the constants changed in it."""
    of_loaded: Callable[..., _Answer] = question

    @wraps(question)
    def asked(profile: ProfileLike, *given: Any, **named: Any) -> _Answer:
        with constants_changed(()):
            loaded = load_profile(profile)
        with constants_changed(loaded.constants):
            return of_loaded(loaded, *given, **named)

    return cast("Callable[_Parameters, _Answer]", asked)


def load_network(profile: ProfileLike) -> Network:
    """Network of a profile that is read and checked as by `load_profile`."""
    return network_of(load_profile(profile))


def require_cycle(profile: Profile, *, question: str, instead: str = "") -> Profile:
    """The profile, if it has a cycle; one of messages alone raises BusplanError.

    `question` is what needs the cycle, for the message; the advice in it is by default the commands that judge
    messages.
    """
    if profile.has_cycle:
        return profile
    advice = instead or "capacity, latency, check, plan, sweep, map and diff judge messages"
    raise BusplanError(f"{profile.name}: a network of messages alone has no cycle, which {question} needs; {advice}")


def values_by_key(values: Mapping[str, object] | None, *, name: str) -> dict[str, object]:
    """New values by dotted key, converted from NumPy; other arguments raise BusplanError."""
    if not isinstance(values, Mapping | None):
        raise ArgumentError(f'{name} {values!r}: expected new values by key, as {{"bus.nodes": 3}}')
    for key in values or {}:
        if not isinstance(key, str):
            raise ArgumentError(f"{name} {key!r}: expected a dotted key of the profile, as bus.nodes")
    return {key: from_numpy(value) for key, value in (values or {}).items()}


def argument(path: FilePath) -> str:
    """PROFILE argument of the command line for a path. Standard input, or no path, raises BusplanError."""
    if not isinstance(path, str | os.PathLike):
        raise BusplanError(f"{path!r}: expected a path, the name of a shipped profile, or a Profile")
    if path == "-":
        raise BusplanError("-: standard input is read by the command line alone; give a file or a shipped profile")
    return path if isinstance(path, str) else os.path.abspath(path)  # noqa: PTH100 - pathlib would resolve links


def recording_name(recording: FilePath) -> str:
    """Path of a recording, as it is written. Standard input, an empty path or no path raises BusplanError."""
    if not isinstance(recording, str | os.PathLike):
        raise BusplanError(f"recording {recording!r}: expected the path of a file")
    source = os.fspath(recording)
    if source == "-" or "\0" in source:
        raise BusplanError(f"{source}: a recording is read from a file")
    given_path(source)
    return source


def from_numpy(value: Any) -> Any:
    """A NumPy number or array as Python data; anything else unchanged."""
    return value.tolist() if hasattr(value, "tolist") else value


def items(values: Iterable[_Item], *, name: str) -> list[_Item]:
    """List of values, converted from NumPy. A single value, or none, raises BusplanError."""
    plain_values = from_numpy(values)
    if isinstance(plain_values, str) or not isinstance(plain_values, Iterable):
        raise ArgumentError(f"{name} {values!r}: expected several values, as a list")
    python_values = [from_numpy(value) for value in plain_values]
    if not python_values:
        raise ArgumentError(f"{name}: no values; give at least one")
    return python_values


def one_or_several(values: Any, *, name: str) -> list[Any]:
    """List of one value or of several, converted from NumPy. No value raises BusplanError."""
    plain_values = from_numpy(values)
    is_one = isinstance(plain_values, str | os.PathLike) or not isinstance(plain_values, Iterable)
    return [plain_values] if is_one else items(plain_values, name=name)


def checked_models(timing_model: Models | None, network: Network) -> tuple[str, ...]:
    """Names of one or several timing models, checked; None stands for all that can express the network.

    An unknown or a repeated name, no name, or a model that cannot express the profile raises BusplanError.
    """
    if timing_model is None:
        return model_names(network)
    models = one_or_several(timing_model, name="timing_model")
    names = [model.name for model in network.bus.timing_models]
    if len(set(map(str, models))) != len(models) or not set(map(str, models)) <= set(names):
        raise ArgumentError(
            f"timing_model {timing_model!r}: expected {listed([*map(repr, names)], 'or')}, or a list of them, each once"
        )
    return tuple(checked_model(network, model, name="timing_model") for model in models)


def checked_model(network: Network, model: str, *, name: str) -> str:
    """Name of a timing model, checked; `name` is that of the parameter.

    A model that the kind of bus does not have, or that cannot express the profile, raises BusplanError.
    """
    bus = network.bus
    names = [model.name for model in bus.timing_models]
    if model not in names:
        raise ArgumentError(f"{name} {model}: no timing model of bus.kind {bus.kind}; there are {', '.join(names)}")
    keys = bus.cannot_express(network, model=model)
    if keys:
        raise ArgumentError(
            f"{name} {model}: not applicable, the {model} model has no {', '.join(keys)}; use {bus.deciding_model}"
        )
    return model


def finite(value: object, *, name: str) -> float:
    """A finite number. NaN, infinity, a bool or no number raises BusplanError."""
    number = from_numpy(value)
    # The range is checked first, because float() of a huge int would raise OverflowError.
    if type(number) not in (int, float) or not -MOST_FLOAT <= number <= MOST_FLOAT:
        raise ArgumentError(f"{name} {number!r}: expected a finite number")
    return float(number)


def whole_number(value: object, *, name: str) -> int:
    """A whole number from 1 to the largest count in a profile. Anything else raises BusplanError."""
    number = from_numpy(value)
    if type(number) is not int or not 1 <= number <= MAX_COUNT:
        raise ArgumentError(f"{name} {number!r}: expected a whole number from 1 to {MAX_COUNT:,}")
    return number


Origin = tuple[str, KeyChanges]
"""A PROFILE argument of the command line, and the changes of that profile by its options."""


def origin_of(profile: Profile) -> Origin:
    """PROFILE argument and `--set` options that give a profile on the command line.

    They are the shipped profile of the same name, with the changes that turn it into this one; or NAME.toml without
    changes, if there is no such shipped profile or no option can make a change.

    Examples
    --------
    >>> from busplan.profile.document import override
    >>> changed = override(load("paper-4ms").profile, {"bus.nodes": 3})
    >>> origin_of(changed)[0], origin_of(changed)[1].words
    ('paper-4ms', '--set bus.nodes=3')
    """
    changes = _changes_of_shipped(profile) if profile.name in shipped_names() else None
    return (f"{profile.name}.toml", NO_CHANGES) if changes is None else (profile.name, changes)


def key_changes(values: Mapping[str, object]) -> KeyChanges:
    """Changes of a profile from new values by dotted key, as `--set` options.

    Values not by key, keys that overlap, or a value that TOML cannot write raise BusplanError.
    """
    changes = []
    for key, value in values_by_key(values, name="changes").items():
        try:
            changes.append(KeyChange(key, value, text=f"{key}={value_text(value)}"))
        except (TypeError, ValueError):
            raise BusplanError(f"changes {key}: {value!r} is no value of a profile") from None
    return KeyChanges(tuple(changes))


def _changes_of_shipped(profile: Profile) -> KeyChanges | None:
    """Changes that turn the shipped profile of the same name into this one; None if no changes do."""
    shipped = load(profile.name).profile
    old, new = dotted_keys(shipped), dotted_keys(profile)
    differing = {key: place.value for key, place in new.items() if key not in old or old[key].value != place.value}
    differing |= {f"constants.{name}": value for name, value in profile.constants}
    try:
        changes = key_changes(differing)
        return changes if changes.applied(shipped) == profile else None
    except (BusplanError, TypeError):  # No option removes a key or a group.
        return None
