"""The options of a plan as one table."""

from typing import Final

from busplan.buses.figure import MARGIN_CORRECTED, SAFE_AXES, SAFE_NODES, UNCERTAINTY
from busplan.buses.parts import Value as BusValue
from busplan.forms.blocks import (
    Cell,
    ShownValue,
    Table,
    TableColumn,
    TableRow,
    Words,
    attribute_value,
    joined,
    sentence,
)
from busplan.forms.numbers import MISSING, period_value
from busplan.questions.fit.certainty import FITS, limits_behind
from busplan.questions.fit.network import bus_of
from busplan.questions.plan.option import Option
from busplan.questions.plan.planning import Plan
from busplan.questions.words.key_values import NewValues, key_value, settings_sentence
from busplan.sections.profile import Profile


def options_table(plan: Plan) -> Table:
    """Settings and results of each option; the recommended one has a mark."""
    columns = (
        TableColumn("option", kind="words"),
        TableColumn("", kind="words"),
        TableColumn("set", kind="words", wraps=True),
        TableColumn("largest term", kind="words", rank=2),
        *(TableColumn(heading, kind="words") for heading in ("held by", "circle")),
        *(TableColumn(heading, "us") for heading in ("margin", "+/-")),
        *(TableColumn(heading, group="safe", rank=1) for heading in ("nodes", "axes")),
    )
    return Table(columns, tuple(map(_row, plan.options)), heads=2)


def _row(option: Option) -> TableRow:
    passed = option.circle_passed
    circle: Cell = MISSING if option.circle_failures is None else "not judged"
    if passed is not None:
        circle = Words("passes", "passes") if passed else Words("FAILS", "fails")
    if option.deciding.circle_refused_by:
        circle = Words("cannot be run", "fails")
    cells: tuple[Cell, ...] = (
        option.title,
        "*" * option.recommended + "?" * (not option.proven),
        _short(option.profile, option.changes),
        bus_of(option.profile).figures.term_label(option.deciding.binding_term),
        ShownValue(option.held_by, "held_by"),
        circle,
        *option_margin(option),
        *(attribute_value(one, option.deciding) for one in (SAFE_NODES, SAFE_AXES)),
    )
    return TableRow(cells, highlighted=option.recommended)


def option_margin(option: Option) -> tuple[ShownValue, ShownValue]:
    """Margin less the bias, and its uncertainty.

    Parameters
    ----------
    option
        The option.
    """
    margin, doubt = (attribute_value(one, option.deciding) for one in (MARGIN_CORRECTED, UNCERTAINTY))
    one = option.deciding
    # A margin beyond its uncertainty is none of the causes where limits of the bus are.
    beyond_us = (one.margin_corrected_us or 0.0) - (one.uncertainty_us or 0.0)
    is_enough = one.verdict == FITS or (beyond_us > 0 and limits_behind(one))
    return margin._replace(state="neutral" if is_enough else "fails"), doubt


_SHORT: Final = {
    "bus.nodes": "{} nodes",
    "cycle.period_us": "{}",
    "cycle.slice_ratio": "ratio {}",
    "servo.step_us": "step {}",
    "payload.read_bytes": "read {} bytes",
    "payload.write_bytes": "write {} bytes",
    "payload.read_bytes_per_axis": "read {} bytes an axis",
    "payload.write_bytes_per_axis": "write {} bytes an axis",
}


_BOTH: Final = ("payload.read_bytes", "payload.write_bytes")


def _short(profile: Profile, changes: NewValues) -> Cell:
    """The settings of an option, in a few words."""
    if not changes:
        return MISSING
    sizes = {key: value for key, value in changes.items() if key in _BOTH}
    alike = len(sizes) == len(_BOTH) and len(set(sizes.values())) == 1
    shown = {key: value for key, value in changes.items() if not alike or key != _BOTH[-1]}
    own = {name: key.short for name, key in bus_of(profile).keys.items() if key.short}
    words = {**_SHORT, **own, **({_BOTH[0]: "payload {} bytes"} if alike else {})}
    return joined(
        *(
            sentence(_counted(words[key], value), _short_value(key, value))
            if key in words
            else settings_sentence({key: value}, meanings={})
            for key, value in shown.items()
        ),
        by=", ",
    )


def _counted(words: str, value: BusValue) -> str:
    """The words of a value, of one byte or node in the singular."""
    return words.replace(" bytes", " byte").replace(" nodes", " node") if value == 1 else words


def _short_value(key: str, value: BusValue) -> ShownValue:
    found = key_value(key, value)
    return found._replace(unit=period_value(float(value)).unit) if key.endswith("_us") else found
