"""Keys of a profile as inputs of a derivation, each with its grade and source."""

from types import MappingProxyType
from typing import Any, Final

from busplan.buses.bus import Bus
from busplan.buses.parts import Key
from busplan.elementwise import GivenTable, Traced
from busplan.profile.kinds import cycle_keys, models_of
from busplan.profile.toml import comment_grade
from busplan.questions.fit.network import bus_of
from busplan.sections.base import value_at, with_all_unchecked
from busplan.sections.execution import TableExecution
from busplan.sections.profile import Profile
from busplan.sourced import SYMBOLS, Input

_SYMBOLS: Final = MappingProxyType(
    {
        "payload.read_bytes": "P_read",
        "payload.write_bytes": "P_write",
        "node.axes": "axes_node",
        "node.execution.base_us": "base",
        "node.execution.per_byte_us": "per_byte",
    }
)
"""Symbol of a key in formulas, unless the equations or a kind of bus define it."""
_TABLE: Final = "execution.time_us"


def given(profile: Profile, key: str) -> Input:
    """Make an input from a key of a profile.

    Parameters
    ----------
    profile
        The profile.
    key
        Dotted key, as "cycle.period_us".

    Returns
    -------
    Input
        Its grade is the one beside it, as bus.master_grade of bus.master_us; that of its section, if the section has
        one; that of a sourced figure, if the value is that figure; that of its comment in the file; otherwise "given".
    """
    *sections, name = key.split(".")
    section: Any = profile
    is_set, own_grade, graded_by = True, None, ""
    for number, part in enumerate(sections, start=1):
        is_set = is_set and (isinstance(section, tuple) or part in section.model_fields_set)
        section = value_at(profile, ".".join(sections[:number]))
        if getattr(section, "grade", None):
            own_grade, graded_by = section.grade, f"; graded by {'.'.join(sections[:number])}.grade"
    beside = f"{name.removesuffix('_us')}_grade"
    if getattr(section, beside, None):
        own_grade, graded_by = getattr(section, beside), f"; graded by {'.'.join(sections)}.{beside}"
    is_set = is_set and name in section.model_fields_set
    description, _, unit = (type(section).model_fields[name].description or "").rstrip("]").partition(" [")
    value = getattr(section, name)
    bus = bus_of(profile)
    # What is off by default is nobody's measurement, and a word that chooses is none.
    is_no_measurement = (not is_set and not value) or _chooses(profile, key)
    grade = "given" if own_grade is None or is_no_measurement else own_grade
    source = f"{f'profile {profile.name}' if is_set else 'default'}{graded_by}"
    alike_key, group = _of_one_table(profile, key)
    known = bus.keys.get(alike_key, Key())
    default = known.default
    if default is not None and value == default:
        grade, source = default.grade, f"{source}, as {default.source}"
    by_comment = comment_grade(profile, key) if is_set and grade == "given" else None
    if by_comment is not None:
        grade, source = by_comment, f"{source}; graded by its comment"
    else:
        grade = known.grade or grade
    # A plain number shows no unit.
    unit = "" if unit == "1" else unit
    symbol = _SYMBOLS.get(alike_key) or known.symbol or SYMBOLS.get(name) or name
    symbol = f"{symbol},{group}" if group else symbol
    return Input(symbol, key, value, unit, grade, source, description)


def traced(profile: Profile, key: str) -> Traced:
    """Make a traced number from a key of a profile."""
    input_ = given(profile, key)
    return Traced(input_.value, given=input_)


def traced_profile(profile: Profile) -> Profile:
    """Return a copy with traced numbers in all keys that the cycle may depend on, unvalidated.

    So are words that choose between numbers.
    """
    values: dict[str, object] = {}
    for key in cycle_keys(profile):
        value = value_at(profile, key)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if is_number or (isinstance(value, str) and _chooses(profile, key)):
            values[key] = traced(profile, key)
    for alike in profile.alike_nodes:
        execution, key = alike.node.execution, alike.node_key(_TABLE)
        if isinstance(execution, TableExecution):
            table = GivenTable(execution.time_us)
            symbol = f"table,{alike.name}" if alike.name else "table"
            table.given = given(profile, key)._replace(symbol=symbol, value=f"{len(execution.time_us)} points")
            values[key] = table
    return with_all_unchecked(profile, values)


def _chooses(profile: Profile, key: str) -> bool:
    """Whether a key is text-valued and selects a formula."""
    own = choosing_keys(bus_of(profile))
    return any(key == alike.node_key(name) for alike in profile.alike_nodes for name in own)


def choosing_keys(bus: Bus) -> tuple[str, ...]:
    """Text-valued keys of a node that select a formula."""
    own = (name.removeprefix("node.") for name, key in bus.keys.items() if key.chooses)
    return ("execution.grade", *own)


def _of_one_table(profile: Profile, key: str) -> tuple[str, str]:
    """The key without the name of its table, where a key has several, and that name.

    That of a group is as it is where all nodes are alike.
    """
    section, _, rest = key.partition(".")
    if not isinstance(getattr(profile, section), tuple):
        return key, ""
    group, _, name = rest.partition(".")
    if section != "group":
        return f"{section}.{name}", group
    if name == "nodes":
        return "bus.nodes", group
    (payload,) = models_of(type(profile).model_fields["payload"].annotation)
    return f"{'payload' if name in payload.model_fields else 'node'}.{name}", group
