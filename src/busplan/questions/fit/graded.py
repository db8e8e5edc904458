"""Keys of a profile as inputs of a derivation with grade and source, and the assumptions that a verdict rests on."""

from collections.abc import Iterator
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from busplan.buses.bus import Bus
from busplan.buses.network import Network
from busplan.buses.parts import Key
from busplan.elementwise import GivenTable, Traced
from busplan.profile.document import comment_grade
from busplan.profile.kinds import cycle_keys, models_of
from busplan.questions.fit.figures import CycleFigures, FitFigures
from busplan.questions.fit.network import at_once, bus_of, trial
from busplan.sections.base import beside, value_at
from busplan.sections.cycle import TableExecution
from busplan.sections.profile import Profile
from busplan.sourced import SYMBOLS, Input, Sourced

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
    """Input of a derivation from a key of a profile.

    Its grade is the first of these: that of its sourced default, if it has that value; the key beside it, such as
    bus.master_grade for bus.master_us; measured with the cycles of which it is the worst; the grade of its section; its
    comment in the file; "given". A grade that the
    kind of bus sets for the key replaces all but that of a comment.
    """
    *sections, name = key.split(".")
    section: Any = profile
    is_set, own_grade, graded_by = True, None, ""
    for number, part in enumerate(sections, start=1):
        is_set = is_set and (isinstance(section, tuple) or part in section.model_fields_set)
        section = value_at(profile, ".".join(sections[:number]))
        if getattr(section, "grade", None):
            own_grade, graded_by = section.grade, f"; graded by {'.'.join(sections[:number])}.grade"
    grade_name = beside(name, "grade")
    if getattr(section, grade_name, None):
        own_grade, graded_by = getattr(section, grade_name), f"; graded by {'.'.join(sections)}.{grade_name}"
    if cycles := getattr(section, beside(name, "cycles"), None):
        own_grade, graded_by = "measured", f"; the worst of {int(cycles):,} measured cycles"
    is_set = is_set and name in section.model_fields_set
    description, _, unit = (type(section).model_fields[name].description or "").rstrip("]").partition(" [")
    value = getattr(section, name)
    bus = bus_of(profile)
    # A default of zero and a word that selects a formula are not measured: a grade beside them does not apply.
    if (not is_set and not value) or _selects_formula(profile, key):
        own_grade, graded_by = None, ""
    grade = own_grade or "given"
    source = f"{f'profile {profile.name}' if is_set else 'default'}{graded_by}"
    common_key, group = _common_key(profile, key)
    bus_key = bus.keys.get(common_key, Key())
    default = bus.constants.get(bus_key.default)
    if default is not None and value == default:
        grade, source = default.grade, f"{source}, as {default.source}"
    # A worst that was measured on another machine is assumed of this one.
    is_open = grade == "given" or cycles
    by_comment = comment_grade(profile, key) if is_set and is_open else None
    if by_comment is not None:
        grade, source = by_comment, f"{source}; graded by its comment"
    else:
        grade = bus_key.grade or grade
    # A plain number shows no unit.
    unit = "" if unit == "1" else unit
    symbol = _SYMBOLS.get(common_key) or bus_key.symbol or SYMBOLS.get(name) or name
    symbol = f"{symbol},{group}" if group else symbol
    return Input(symbol, key, value, unit, grade, source, description)


def traced_network(network: Network) -> Network:
    """The network with traced values of all keys that its cycle may depend on.

    These are numbers, and words that choose a formula.
    """
    profile = network.profile
    values: dict[str, object] = {}
    for key in cycle_keys(profile):
        value = value_at(profile, key)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if is_number or (isinstance(value, str) and _selects_formula(profile, key)):
            values[key] = Traced(value, given=given(profile, key))
    for group in profile.node_groups:
        execution, key = group.node.execution, group.node_key(_TABLE)
        if isinstance(execution, TableExecution):
            table = GivenTable(execution.time_us)
            symbol = f"table,{group.name}" if group.name else "table"
            table.given = given(profile, key)._replace(symbol=symbol, value=f"{len(execution.time_us)} points")
            values[key] = table
    return trial(network, values)


def _selects_formula(profile: Profile, key: str) -> bool:
    """Whether the value of a key is a word that selects a formula."""
    common_key, _ = _common_key(profile, key)
    return common_key in {f"node.{name}" for name in choosing_keys(bus_of(profile))}


def choosing_keys(bus: Bus) -> tuple[str, ...]:
    """Keys of a node whose value is a word that selects a formula."""
    return ("execution.grade", *(name.removeprefix("node.") for name, key in bus.keys.items() if key.chooses))


def _common_key(profile: Profile, key: str) -> tuple[str, str]:
    """The key without the name of its table, and that name.

    The key of a group becomes that of a profile whose nodes are all alike.
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


_HEAVY_SHARE: Final = Sourced(
    0.25,
    unit="1",
    grade="assumed",
    source="chosen",
    meaning="share of the variance, or of the required time, above which a verdict rests on a key",
)
_EXECUTION: Final = "execution"
_INFINITE_KBIT_S: Final = 1e12
"""A bit rate so high that sending takes no time [kbit/s]."""
_Share = tuple[tuple[str, ...], float, str]
"""Keys, the share that they carry [1], and of what."""


class HeavyAssumption(NamedTuple):
    """An assumed key, or the assumed execution times together, with a large share of the time or of the variance."""

    keys: tuple[str, ...]
    """Dotted keys: one, or the section of each group's execution time, as these err together."""
    carries: str
    """The shares in words, beginning with the verb."""
    share: float
    """The largest share."""

    @property
    def is_execution(self) -> bool:
        """Whether the keys are execution times."""
        return self.keys[0].endswith(f".{_EXECUTION}")

    @property
    def is_bit_rate(self) -> bool:
        """Whether the key is a bit rate, which is looked up and not measured."""
        return self.keys[0].endswith("bit_rate_kbit_s")


def heavy_assumptions(figures: FitFigures, network: Network) -> tuple[HeavyAssumption, ...]:
    """The assumptions that carry more than a quarter of the variance or of the time; of messages alone, of the load."""
    shares = _shares_of_cycle(figures, network) if isinstance(figures, CycleFigures) else _shares_of_load(network)
    carried: dict[tuple[str, ...], list[tuple[str, float]]] = {}
    for keys, share, whole in shares:
        if share > _HEAVY_SHARE:
            carried.setdefault(keys, []).append((f"{share:.0%} of {whole}", share))
    return tuple(
        HeavyAssumption(
            keys,
            f"{'carries' if len(keys) == 1 else 'together carry'} {' and '.join(words for words, _ in parts)}",
            max(share for _, share in parts),
        )
        for keys, parts in carried.items()
    )


def _shares_of_cycle(cycle: CycleFigures, network: Network) -> Iterator[_Share]:
    """Shares of assumptions in the variance of a cycle and in its required time."""
    variance, profile = sum(float(doubt.us) ** 2 for doubt in cycle.doubts), network.profile
    shares: list[_Share] = [
        ((doubt.key,), float(doubt.us) ** 2 / variance, "the variance") for doubt in cycle.doubts if variance
    ]
    shares += [((term.rests_on,), term.us / cycle.required_us, "the required time") for term in cycle.terms]
    # Only keys of the profile have a grade. Execution times come below: they share terms and uncertainty components.
    yield from (share for share in shares if share[1] > _HEAVY_SHARE and _is_assumed(profile, share[0][0]))
    yield from _execution_shares(cycle, network, variance)
    for key, unlimited in _unlimited(network):
        faster = network.bus.cycle(unlimited._replace(period_us=cycle.period_us), model=cycle.timing_model)
        yield (key,), 1 - faster.required_us / cycle.required_us, "the required time"


def _shares_of_load(network: Network) -> Iterator[_Share]:
    """Shares of assumed bit rates in the load of messages alone: what an infinite rate saves."""
    load = network.bus.limit("load")
    if load is not None:
        for key, unlimited in _unlimited(network):
            yield (key,), 1 - load.value(unlimited) / load.value(network), "the load"


def _is_assumed(profile: Profile, key: str) -> bool:
    return isinstance(value_at(profile, key), int | float | str) and given(profile, key).grade == "assumed"


def _execution_shares(figures: CycleFigures, network: Network, variance: float) -> list[_Share]:
    """Shares of the assumed execution times in the variance, and in the required time: terms shrink without them."""
    network, bus = network._replace(period_us=figures.period_us), network.bus
    assumed = [
        group
        for group in network.groups
        if group.node.execution.grade == "assumed" and bus.has_execution(network._replace(groups=(group,)))
    ]
    if not assumed:
        return []
    without = network._replace(groups=tuple(at_once(group) if group in assumed else group for group in network.groups))
    cycle, keys = bus.cycle(without, model=figures.timing_model), tuple(group.key(_EXECUTION) for group in assumed)
    whole_us, rest_us = (
        sum(float(doubt.us) for doubt in doubts if doubt.key.endswith(f".{_EXECUTION}"))
        for doubts in (figures.doubts, cycle.doubts())
    )
    rest = {term.key: term.us for term in cycle.terms}
    # A term that grows without execution times, such as the wait for a gap, is not due to them.
    carried_us = sum(max(0.0, term.us - rest[term.key]) for term in figures.terms)
    of_time = (keys, carried_us / figures.required_us, "the required time")
    return [(keys, whole_us * (whole_us - rest_us) / variance, "the variance"), of_time] if variance else [of_time]


def assumed_rates(network: Network) -> tuple[str, ...]:
    """Keys of the bit rates that a profile calls assumed."""
    return tuple(key for key in network.bus.rate_keys if _is_assumed(network.profile, key))


def _unlimited(network: Network) -> Iterator[tuple[str, Network]]:
    """Each assumed bit rate, with the network where it is infinite."""
    return ((key, trial(network, {key: _INFINITE_KBIT_S})) for key in assumed_rates(network))
