"""The machine of a profile on another kind of bus, with the bus section of a new profile of that kind.

The machine is what profiles of every kind have: nodes, axes, payloads, execution times, the period, the share of it for
communication, the servo and the circle; also its cables and its host, by whatever key. Keys of its own kind alone are
left out, and those that only the new kind has are assumed.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any, Final, Literal, NamedTuple

from pydantic import BaseModel

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.parts import KeyRole
from busplan.profile.document import TomlTable, comment_grade, profile_of
from busplan.profile.kinds import dotted_keys, flat, holder, models_of, named_tables
from busplan.sections.base import TRANSACTION_KINDS, beside
from busplan.sections.profile import Profile

_KIND, _NODES = "kind", "nodes"
_SIZES = ("read_bytes", "write_bytes")
_EVERY = "every"
"""Rate of a group, on kinds with several rates."""
_OF_HOST: Final[tuple[KeyRole, ...]] = ("host", "wake-up", "pipeline")
_BESIDE: Final = ("grade", "uncertainty_us", "cycles")
_GRADES: Final = ("measured", "derived", "calibrated", "assumed")
"""Grades that a key of a grade takes."""


class AssumedKey(NamedTuple):
    """A key whose value does not come from the machine."""

    key: str
    value: Any
    source: Literal["new profile", "default", "setting", "profile"]
    """Source of the value: what `init` writes, the kind's default, a setting that the machine needs, or the profile,
    which grades it assumed.
    """


class Conversion(NamedTuple):
    """A machine on a kind of bus."""

    profile: Profile
    assumed: tuple[AssumedKey, ...]
    """Keys of the new kind; empty on the profile's own."""
    left_out: tuple[str, ...]
    """Keys and sections of the profile that the kind does not have."""
    of_host: Mapping[str, str] = {}
    """Keys of the profile's host by their names on the kind."""


def converted(profile: Profile, kind: str, *, variant: str = "") -> Conversion:
    """Put the machine of a profile on a kind of bus; its own kind leaves it as it is.

    Execution times stay equal, which is assumed. An empty variant is the usual one. A machine that no profile of the
    kind can describe raises BusplanError; each problem names its key.

    Examples
    --------
    >>> from busplan.profile.sources import load
    >>> conversion = converted(load("paper-4ms").profile, "can")
    >>> conversion.profile.bus.kind, conversion.profile.bus.nodes, conversion.profile.node.axes
    ('can', 2, 4)
    """
    if kind == profile.bus.kind and not variant:
        return Conversion(profile, (), ())
    data = profile.model_dump(exclude_unset=True)
    for table, group in zip(data.get("group", ()), profile.group, strict=True):
        # The other kind may have no default for it.
        table.setdefault("execution", group.execution.model_dump(exclude_none=True))
    machine, left_out = _common(data)
    left_out = _with_rates(machine, profile, left_out, kind=kind)
    _say_payloads(machine, profile)
    # The host keeps its share of the period, whatever the kind's default.
    machine["cycle"]["slice_ratio"] = profile.cycle.slice_ratio
    bus = kind_named(kind)
    cable_key, new = bus.key_of("cable"), tomllib.loads(bus.new_section(variant=variant))
    cables_m = _cables_m(profile)
    if cables_m and cable_key:
        left_out = tuple(key for key in left_out if key not in cables_m)
        section, _, name = cable_key.partition(".")
        for table in [machine["bus"]] if section == "bus" else [machine.get("node"), *machine.get("group", ())]:
            if table is not None:
                table[name] = max(cables_m.values())
    for nodes in (machine.get("node"), *machine.get("group", ())):
        if nodes and "execution" in nodes:
            # It was measured on the other bus.
            nodes["execution"]["grade"] = "assumed"
    values, of_host = _host(profile, bus, variant=variant)
    for key, value in values.items():
        table, last = holder(machine, key)
        table[last] = value
    carried = {*of_host.values(), *(key.rpartition(".")[0] for key in of_host.values())}
    left_out = tuple(key for key in left_out if key not in carried)
    # What a new profile assumes of its host gives way to the machine's own.
    given_way = {key for role in _OF_HOST for key in _keys(bus, role).values() if bus.key_of(role) in values}
    new["bus"] = {name: value for name, value in new["bus"].items() if f"bus.{name}" not in given_way}
    empty = _without_couplers(machine)
    # A key that both have takes the value of the new bus.
    merged = {**machine, **{name: {**machine.get(name, {}), **table} for name, table in new.items()}}
    new_profile = profile_of(merged)
    given = [AssumedKey(key, value, "new profile") for key, value in flat(new) if key != f"bus.{_KIND}"]
    assumed = (*given, *(one for one in _defaults(new_profile) if one.key not in values))
    return Conversion(new_profile, assumed, (*left_out, *empty), of_host)


def _keys(bus: Bus, role: KeyRole) -> dict[str, str]:
    """Dotted keys of a role: that of its value, under "", and those beside it that say how well it is known."""
    key = bus.key_of(role)
    section, _, name = key.partition(".")
    keys = {"": key} if key else {}
    for model in models_of(bus.profile_model().model_fields[section].annotation) if key else ():
        for part in _BESIDE:
            # In a section of the host alone they stand without the name of its time.
            names = [one for one in (beside(name, part), part) if one in model.model_fields]
            if names:
                keys[part] = f"{section}.{names[0]}"
    return keys


def _host(profile: Profile, bus: Bus, *, variant: str) -> tuple[dict[str, Any], dict[str, str]]:
    """What the profile gives of its host, by the keys of another kind; and the names of these keys in the profile."""
    own, said = kind_named(profile.bus.kind), dict(flat(profile.model_dump(exclude_unset=True)))
    values: dict[str, Any] = {}
    names: dict[str, str] = {}
    for role in _OF_HOST[:1] if variant in bus.starter.without_wake_up else _OF_HOST:
        of_own, of_kind = _keys(own, role), _keys(bus, role)
        given = {part: said[key] for part, key in of_own.items() if part in of_kind and said.get(key) is not None}
        if "" not in given or not _takes(bus, of_kind[""], given[""]):
            continue
        names |= {of_kind[part]: of_own[part] for part in given}
        if "grade" in of_kind and (grade := comment_grade(profile, of_own[""])) in _GRADES:
            given.setdefault("grade", grade)
        values |= {of_kind[part]: value for part, value in given.items()}
    return values, names


def _takes(bus: Bus, key: str, value: Any) -> bool:
    """Whether a kind has no larger least value of a key: the pipelines of some begin at one cycle."""
    section, _, name = key.partition(".")
    (model,) = models_of(bus.profile_model().model_fields[section].annotation)
    return all(value >= getattr(bound, "ge", value) for bound in model.model_fields[name].metadata)


def _with_rates(machine: TomlTable, profile: Profile, left_out: tuple[str, ...], *, kind: str) -> tuple[str, ...]:
    """Keep the rates of groups on a kind with rates; returns the keys left out without them."""
    (groups,) = models_of(kind_named(kind).profile_model().model_fields["group"].annotation)
    if _EVERY not in groups.model_fields:
        return left_out
    for table, group in zip(machine.get("group", ()), profile.group, strict=True):
        if _EVERY in group.model_fields_set:
            table[_EVERY] = getattr(group, _EVERY)
    return tuple(key for key in left_out if not (key.startswith("group.") and key.endswith(f".{_EVERY}")))


def _say_payloads(machine: TomlTable, profile: Profile) -> None:
    """Give payloads in bytes where the profile gives them only in keys of its own kind."""
    for place, nodes in enumerate(profile.node_groups):
        section = machine["group"][place] if nodes.name else machine["payload"]
        for kind, key in zip(TRANSACTION_KINDS, _SIZES, strict=True):
            if section.keys().isdisjoint({key, f"{key}_per_axis"}):
                section[nodes.payload.key_of(kind)] = nodes.payload.bytes_of(kind, axes=1)


def _without_couplers(machine: TomlTable) -> tuple[str, ...]:
    """Leave groups without data out, as couplers; returns their keys."""
    groups: Sequence[TomlTable] = machine.get("group", ())
    empty = [group["name"] for group in groups if not any(group.get(key, 1) for key in _SIZES)]
    if empty and len(empty) < len(groups):
        machine["group"] = [group for group in groups if group["name"] not in empty]
    return tuple(f"group.{name}" for name in empty)


def _cables_m(profile: Profile) -> dict[str, float]:
    """Cable lengths of a profile by key [m], without zeros."""
    section, _, name = kind_named(profile.bus.kind).key_of("cable").partition(".")
    tables = [(f"bus.{name}", profile.bus)] if section == "bus" else []
    if section == "node":
        tables = [(nodes.node_key(name), nodes.node) for nodes in profile.node_groups]
    return {
        key: float(getattr(table, name))
        for key, table in tables
        if name in table.model_fields_set and getattr(table, name)
    }


def _common(data: TomlTable) -> tuple[TomlTable, tuple[str, ...]]:
    """Keys that profiles of every kind have, and the names of the others; a section counts as a whole."""
    rest: list[str] = []
    common = _part(data, [Profile], "", rest)
    nodes = data["bus"].get(_NODES)
    common["bus"] = {} if nodes is None else {_NODES: nodes}
    return common, tuple(key for key in rest if key != f"bus.{_NODES}")


def _part(table: Mapping[str, Any], models: Sequence[type[BaseModel]], prefix: str, rest: list[str]) -> TomlTable:
    """Keys of a table that any of the models has; the others go to the rest."""
    kept: TomlTable = {}
    for name, value in table.items():
        fields = [model.model_fields[name] for model in models if name in model.model_fields]
        inner = [model for field in fields for model in models_of(field.annotation)]
        tables = named_tables(value)
        if not fields:
            rest.append(f"{prefix}{name}")
        elif isinstance(value, Mapping):
            kept[name] = _part(value, inner, f"{prefix}{name}.", rest)
        elif tables is not None:
            kept[name] = [
                _part(named_table, inner, f"{prefix}{name}.{table_name}.", rest)
                for table_name, named_table in tables.items()
            ]
        else:
            kept[name] = value
    return kept


def _defaults(profile: Profile) -> Iterator[AssumedKey]:
    """Keys of the profile's own kind that it leaves to their defaults."""
    names = {*_common(profile.model_dump())[1]}
    for key, entry in dotted_keys(profile).items():
        is_own = not names.isdisjoint(accumulate(key.split("."), "{}.{}".format))
        # Keys without a value and empty arrays are left out.
        if is_own and entry.source == "default" and entry.value is not None and entry.value != ():
            yield AssumedKey(key, entry.value, "default")
