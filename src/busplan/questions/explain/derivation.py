"""Derive the figures of a bus: the equations run once more, with numbers that record how they were computed."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import product
from math import isinf
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

from busplan.buses.bus import Bus
from busplan.buses.cycle import BusCycle
from busplan.buses.figure import (
    BIAS,
    CERTAINTY,
    MARGIN,
    MARGIN_CORRECTED,
    REQUIRED,
    SAFE_MIN_PERIOD,
    SAFE_NODES,
    UNCERTAINTY,
    Figure,
    by_key,
    term_name,
)
from busplan.buses.network import Network
from busplan.elementwise import Number, Traced, TracedConstant, value_of, worded
from busplan.english import listed
from busplan.errors import BusplanError
from busplan.forms.blocks import Record
from busplan.questions.base.sentences import fields
from busplan.questions.explain.formula import formula_of, formula_text, inputs, lines
from busplan.questions.fit.certainty import certainty
from busplan.questions.fit.figures import certainty_numbers, numeric_figures
from busplan.questions.fit.graded import choosing_keys, traced_network
from busplan.questions.fit.network import model_names
from busplan.sourced import EQUATIONS, Input, constants_looked_up, short

CommandName = Literal["capacity", "latency"]
_Numbers = Mapping[str, Traced]

GRADES: Final = ("assumed", "recalled", "calibrated", "derived", "measured", "published", "given")
"""Grades from the weakest to the strongest; "given" values are choices, not knowledge."""
_MOST_HINTS: Final = 3
_BESIDE: Final = MappingProxyType({MARGIN_CORRECTED.key: (UNCERTAINTY,)})
"""Figures that are derived together with another: a margin says nothing without its uncertainty."""


_ON_THE_CARD: Final = MappingProxyType(
    {
        "used": (REQUIRED.key, BIAS.key),
        "free": (MARGIN_CORRECTED.key,),
        "shortby": (MARGIN_CORRECTED.key,),
        "fastestperiod": (SAFE_MIN_PERIOD.key,),
        "roomfor": (SAFE_NODES.key,),
    }
)
"""Keys of the figures behind a line of the card of `capacity`, by its label."""


class Step(NamedTuple):
    """A line of a derivation."""

    key: str
    """Key of the figure in the results; for another number, a name used only here."""
    symbol: str
    """Symbol in formulas."""
    reference: str
    """Numbers of the equations, or another source."""
    formula: str
    """Computation in symbols."""
    numbers: str
    """Computation in numbers."""
    value: object
    """Result: a number or a truth value; None if it does not exist."""
    unit: str
    """Unit of the result; empty for counts and shares."""


@dataclass(frozen=True)
class Derivation:
    """A figure and its steps."""

    command: CommandName
    figure: Figure
    timing_model: str
    transaction: str | None
    """Transaction of a figure of `latency`; None for others."""
    period_us: float | None
    """Communication period [us]; None for a network without a cycle."""
    value: object
    """Value as in the command's JSON; None if it does not exist."""
    steps: tuple[Step, ...]
    """Steps in the order of computation. The last one is the figure, unless that is an input."""
    inputs: tuple[Input, ...]
    corrected_us: float | None = None
    """Of a margin by the model that decides, the corrected one, which the verdict uses [us]."""

    @property
    def reference(self) -> str:
        """Numbers of the figure's equations, or another source."""
        return self.steps[-1].reference if self.steps else self.figure.reference

    @property
    def weakest_grade(self) -> str:
        """Grade of the least well known input."""
        return min((given.grade for given in self.inputs), key=GRADES.index, default=GRADES[-1])


class Wanted(NamedTuple):
    """Figures and transactions for which a name stands."""

    command: CommandName
    figures: tuple[Figure, ...]
    transactions: tuple[str, ...] | None = None
    """Transactions for which the name stands; None for all."""


def derive(
    networks: Sequence[Network], name: str, *, timing_models: Sequence[str] | None, transactions: Sequence[str] | None
) -> tuple[Derivation, ...]:
    """Derive a figure, by a name for `wanted`, at the period of each network.

    Without timing models it is the one that decides, or the first that has the figure; without transactions, all that
    have it. BusplanError: there is no such figure, no equation leads to it, or an option does not apply to it.
    """
    network = networks[0]
    meant = wanted(name, network)
    if transactions is not None and meant.command != "latency":
        timed = figures_of(network.bus)["latency"]
        instead = next((f"; latency.{figure.key} has" for figure in meant.figures if figure.key in timed), "")
        raise BusplanError(f"{name}: a figure of {meant.command}, which has no transactions{instead}")
    if transactions:
        meant = meant._replace(transactions=tuple(transactions))
    derivations = tuple(derivation for at in networks for derivation in _at_period(at, meant, timing_models))
    if not derivations:
        raise BusplanError(_why_none(network, meant, timing_models))
    return derivations


def _at_period(network: Network, meant: Wanted, timing_models: Sequence[str] | None) -> Iterator[Derivation]:
    """Derivations of some figures, nested by transaction, figure and timing model."""
    models = timing_models or model_names(network)
    numbers = {model: numbers_of(network, meant.command, model=model) for model in models}
    for transaction, figure in product(meant.transactions or numbers[models[0]], meant.figures):
        having = [model for model in models if figure.key in numbers[model].get(transaction, {})]
        for model in timing_models or having[:1]:
            traced = numbers[model][transaction]
            for shown in (figure, *_least(figure, network.bus, traced), *_BESIDE.get(figure.key, ())):
                if shown.key in traced:
                    found = _derivation(network, traced[shown.key], meant.command, shown, model, transaction or None)
                    uses = traced.get(MARGIN_CORRECTED.key) if shown.key == MARGIN.key else None
                    yield found if uses is None else replace(found, corrected_us=float(value_of(uses)))


def _least(figure: Figure, bus: Bus, traced: _Numbers) -> Iterator[Figure]:
    """The figure of the lower end of another, where the ends differ."""
    least = figures_of(bus)["capacity"].get(f"least_{figure.key}")
    if least and least.key in traced and value_of(traced[least.key]) < value_of(traced[figure.key]):
        yield least


def _derivation(
    network: Network, number: Traced, command: CommandName, figure: Figure, model: str, transaction: str | None
) -> Derivation:
    register = figures_of(network.bus)
    figures = {**register["latency"], **register["capacity"], **register[command]}
    steps = []
    for line in lines(number):
        result = figure if line is number else figures.get(line.key, Figure(line.key, line.key, "", ""))
        formula, numbers = (_INFINITE.sub("none", formula_text(line, in_numbers=way)) for way in (False, True))
        symbol = result.symbol if line is number else line.symbol
        reference = line.reference or result.reference
        steps.append(Step(result.key, symbol, reference, formula, numbers, _existing(line.value), result.unit))
    period_us = value_of(network.period_us) if network.groups else None
    value = _existing(number.value)
    return Derivation(command, figure, model, transaction, period_us, value, tuple(steps), tuple(inputs(number)))


_INFINITE: Final = re.compile(r"\binf\b")


def _existing(value: object) -> object:
    """A value; None for infinity, which stands for a figure that does not exist."""
    return None if isinstance(value, float) and isinf(value) else value


def _why_none(network: Network, meant: Wanted, timing_models: Sequence[str] | None) -> str:
    figure, deciding = meant.figures[0], network.bus.deciding_model
    if timing_models is not None and figure in CERTAINTY and deciding not in timing_models:
        return f"{figure.key}: exists only in the timing model that decides, {deciding}"
    if (meant.command, figure) in explained_figures(network):
        return f"{figure.key}: does not exist under this timing model, or for this transaction"
    return (
        f"{figure.key}: no equation leads to it in {network.profile.name} ({figure.meaning}); busplan explain "
        f"{network.profile.name} --all lists the figures with an equation"
    )


def figures_of(bus: Bus) -> dict[CommandName, dict[str, Figure]]:
    """Figures by command and key. Without a command, a key belongs to the first command that has it."""
    return {"capacity": by_key(bus.figures.capacity), "latency": by_key(bus.figures.latency)}


def numbers_of(network: Network, command: CommandName, *, model: str) -> dict[str, _Numbers]:
    """Figures of a command that equations lead to, in traced numbers, by transaction and key.

    Figures of `capacity` have the transaction "". An infinite number stands for a figure that does not exist.
    """
    figures = figures_of(network.bus)[command]
    # Traced for each command, because a number keeps its first name.
    network = traced_network(network)
    with constants_looked_up(TracedConstant):
        return _numbers_of(network, command, model, figures)


def _numbers_of(
    network: Network, command: CommandName, model: str, figures: Mapping[str, Figure]
) -> dict[str, _Numbers]:
    return {name: _traced(numbers, figures) for name, numbers in _of_command(network, command, model=model).items()}


def _of_command(network: Network, command: CommandName, *, model: str) -> dict[str, dict[str, Number]]:
    """Figures of a command that exist, by transaction and key; those of `capacity` have the transaction ""."""
    cycle, of_all = network.bus.cycle(network, model=model), dict[str, dict[str, Number | None]]()
    if command == "capacity":
        of_all[""] = _of_capacity(cycle, is_decided=model == network.bus.deciding_model)
    else:
        for latency in cycle.latencies():
            given = {"payload_bytes": latency.payload_bytes, "nodes": network.nodes}
            of_all[latency.label] = {**given, **latency.phases}
    return {
        name: {key: number for key, number in of_each.items() if number is not None} for name, of_each in of_all.items()
    }


def _of_capacity(cycle: BusCycle, *, is_decided: bool) -> dict[str, Number | None]:
    if not cycle.network.groups:
        return {**cycle.figures()}
    terms = {term.key: term.us for term in cycle.terms}
    numbers: dict[str, Number | None] = {**terms, **cycle.figures(), **numeric_figures(cycle)}
    if is_decided:
        weighed = certainty(cycle)
        for doubt in weighed.doubts:
            _named(doubt.us, f"{doubt.key}.uncertainty_us", f"u({doubt.label})")
        numbers |= certainty_numbers(weighed, cycle)
    return numbers


def _traced(numbers: Mapping[str, Number], figures: Mapping[str, Figure]) -> dict[str, Traced]:
    """Numbers of the figures by key, each with its symbol."""
    return {key: _named(number, key, figures[key].symbol) for key, number in numbers.items() if key in figures}


def _named(number: Number, key: str, symbol: str) -> Traced:
    """Name a number; a constant becomes a line of its own."""
    if isinstance(number, TracedConstant):
        number = worded(number, number.meaning)
    if isinstance(number, Traced):
        return number.named(key, symbol)
    return Traced(number, formula=short(number), numbers=short(number)).named(key, symbol)


def explained_figures(network: Network) -> list[tuple[CommandName, Figure]]:
    """Figures of a network that an equation leads to, each with its command, in the order of their documents."""
    explained: list[tuple[CommandName, Figure]] = []
    for command, figures in figures_of(network.bus).items():
        # The same figures exist in plain numbers, which are faster than traced ones.
        of_models = (_of_command(network, command, model=model).values() for model in model_names(network))
        found = {key for of_each in of_models for numbers in of_each for key in numbers}
        explained += [(command, figure) for key, figure in figures.items() if key in found]
    return explained


def latency_names(network: Network) -> tuple[str, ...]:
    """Names of the transactions in `latency`, or of the cycle."""
    return tuple(latency.label for latency in network.bus.cycle(network, model=network.bus.deciding_model).latencies())


def wanted(name: str, network: Network) -> Wanted:
    """Figures and transactions for which a name stands.

    The name is a key ("required_us"), also after its command ("latency.gaps_us"); the number of an equation ("(11)");
    the label or the symbol of a figure in tables ("arbitration"); or the name of a transaction, a message or a group.
    An unknown one raises BusplanError, which suggests similar names.

    Examples
    --------
    >>> from busplan.questions.base.arguments import load_network
    >>> [figure.key for figure in wanted("(11)", load_network("paper-4ms")).figures]
    ['nodes_eq11']
    >>> wanted("sdo-request", load_network("can-servo-8")).transactions
    ('sdo-request',)
    """
    register = figures_of(network.bus)
    before, _, key = name.rpartition(".")
    commands = [command for command in register if before in ("", command)]
    equation = re.fullmatch(r"\(?(\d+)\)?", name)
    for is_meant in (
        lambda figure: figure.key == key,
        lambda figure: equation is not None and figure.reference == f"({equation[1]})",
        lambda figure: equation is not None and f"({equation[1]})" in figure.reference.split(),
        lambda figure: _letters(key) in _names(figure) - {""},
        lambda figure: figure.key in _ON_THE_CARD.get(_letters(key), ()),
        lambda figure: key == figure.symbol,
    ):
        for command in commands:
            if figures := tuple(figure for figure in register[command].values() if is_meant(figure)):
                return Wanted(command, figures)
    labels = latency_names(network)
    transactions = tuple(label for label in labels if _letters(name) in map(_letters, (label, *label.split())))
    if transactions or (name and name in network.names):
        # All other figures of `latency` lead to this one.
        timed = network.bus.figures
        main = timed.deadlines[0] if timed.deadlines else timed.latency_main or timed.latency_table[-1].key
        return Wanted("latency", (register["latency"][main],), transactions or None)
    raise BusplanError(f"{name or repr(name)}: no such figure{_hint(name, network)} one, explain --all lists them")


def _names(figure: Figure) -> set[str]:
    """Other names of a figure: in tables, and among the other terms."""
    return {_letters(figure.label), _letters(term_name(figure.key))}


def _letters(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def _hint(name: str, network: Network) -> str:
    names = {_letters(label): label for label in (*network.names, *latency_names(network))}
    for _, figure in explained_figures(network):
        names |= {**dict.fromkeys(_names(figure), figure.key), _letters(figure.key): figure.key}
    key = _letters(name.rpartition(".")[2])
    near = [word for word in names if word.startswith(key)] + get_close_matches(key, names, cutoff=0.5)
    close = dict.fromkeys(names[word] for word in near if key)
    return f", did you mean {listed([*close][:_MOST_HINTS], 'or')}? Without" if close else "; without"


def assumptions(network: Network) -> tuple[Input, ...]:
    """Inputs on which the verdict rests, each with its grade, the least well known first.

    They are those of the cycle under every timing model, of its uncertainty and of the limits, without "given" ones. An
    execution time without a grade comes first: it is a fact, not a choice.
    """
    profile, bus = network.profile, network.bus
    limited = traced_network(network)
    numbers: list[Number] = []
    for model in model_names(network):
        traced = numbers_of(network, "capacity", model=model)[""]
        numbers += [traced[key] for key in ("required_us", "available_us", "safe_required_us") if key in traced]
    for limit in bus.limits:
        # A value that depends on nothing, as that of a schedule which the profile does not have, breaks no limit.
        if limit.role != "safety" and isinstance(value := limit.value(limited), Traced):
            numbers += (value, limit.most(limited), limit.uncertainty(limited))
    by_name: dict[str, Input] = {}
    for given in inputs(Traced(None, parts=tuple(numbers))):
        by_name.setdefault(given.name, given)
    executions = tuple(group.node_key("execution.") for group in profile.node_groups)

    def rank(given: Input) -> int:
        """Rank of an input by its grade; a choice comes after all grades."""
        if given.grade != "given":
            return GRADES.index(given.grade)
        is_time = given.name.startswith(executions) and not given.name.endswith(choosing_keys(bus))
        return -1 if is_time and not given.source.startswith("default") else len(GRADES)

    return tuple(sorted((given for given in by_name.values() if rank(given) < len(GRADES)), key=rank))


def equation_rows(bus: Bus) -> list[Record]:
    """One row for each equation of a kind, or of all kinds: numbers, formula, function and source."""
    # Other kinds may have been loaded, too.
    packages = [_package(type(bus)), _package(Bus)]
    return [
        {
            "reference": equation.reference,
            "formula": f"{equation.symbol} = {formula_of(equation)}",
            "function": name,
            "source": equation.source,
        }
        for name, equation in sorted(EQUATIONS.items(), key=lambda item: item[1].numbers[0])
        if _package(equation.function) in packages
    ]


def _package(function: Callable[..., object]) -> str:
    """Package of the module with a function or a class."""
    return function.__module__.rpartition(".")[0]


def constant_rows(bus: Bus) -> list[Record]:
    """One row for each constant: value, unit, grade and source."""
    return [
        {"name": name, "value": float(constant), **fields(constant, "unit", "grade", "source", "meaning")}
        for name, constant in bus.constants.items()
    ]
