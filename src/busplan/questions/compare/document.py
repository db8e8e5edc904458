"""Document and rows of `busplan compare`."""

from typing import Any

from busplan.buses import kind_named
from busplan.buses.bus import Bus
from busplan.buses.published import parts_tested
from busplan.elementwise import plain
from busplan.forms.blocks import JsonDocument, Record
from busplan.questions.compare.kinds import CircleAtSmallest, KindComparison, MachineOnKind, NotOnKind, SafeAxes
from busplan.questions.fit.network import bus_of, network_of
from busplan.questions.words.documents import document, parts_by, with_profile

_FIGURES = (
    *("timing_model", "verdict", "safe", "exceeded", "not_shown", "circle_refused_by", "available_us", "required_us"),
    *("bias_us", "margin_corrected_us", "uncertainty_us", "binding_term"),
)
_SAFE = ("safe_nodes", "safe_axes", "safe_limited_by")
_MEASURES = ("mean_contour_error_mm", "max_contour_error_mm", "circular_deviation_mm")


def compare_document(found: KindComparison) -> JsonDocument:
    """Document of `busplan compare --format json`."""
    network = network_of(found.profile)
    return document(
        "compare",
        profile=found.profile.name,
        kind=found.profile.bus.kind,
        period_us=found.profile.cycle.period_us,
        nodes=int(plain(network.nodes)),
        axes=int(plain(network.axes)),
        counted_group=found.counted or None,
        with_circle=found.with_circle,
        buses=[_bus_record(one) for one in found.kinds],
    )


def compare_records(found: KindComparison) -> list[Record]:
    """One row for each kind, for CSV: of the lists the keys, of the circle what was decided."""
    return with_profile(found.profile.name, [_row(record) for record in map(_bus_record, found.kinds)])


def _row(record: Record) -> Record:
    circle = record["circle"] or {"passed": None, "step_us": None}
    flat = {key: value for key, value in record.items() if key not in {"circle", "curve", "assumed"}}
    return {
        **flat,
        **{key: [one["part"] for one in record[key]] for key in ("set_by", "tested")},
        "assumed": [one["key"] for one in record["assumed"]],
        "circle_passed": circle["passed"],
        "circle_step_us": circle["step_us"],
    }


def _bus_record(one: MachineOnKind | NotOnKind) -> Record:
    """A kind of bus as plain data; what a kind that cannot have the machine lacks is null."""
    if isinstance(one, NotOnKind):
        empty: Record = dict.fromkeys(
            (*_FIGURES, "verdict_after_reset", *_SAFE, "smallest_period_us", "no_period", "circle")
        )
        lists: Record = {"assumed": [], "assumed_host": [], "left_out": [], "curve": []}
        return {**_head(one.kind, is_own=False, why_not=list(one.why)), **empty, **lists}
    bus = bus_of(one.profile)
    return {
        **_head(bus.kind, is_own=one.is_own, why_not=[]),
        **{key: _plain(getattr(one.figures, key)) for key in _FIGURES},
        "verdict_after_reset": None if one.after_reset is None else one.after_reset.verdict,
        **_safe_record(one.safe),
        "smallest_period_us": one.smallest.us,
        "no_period": one.smallest.why or None,
        "circle": None if one.circle is None else _circle_record(one.circle),
        "assumed": [{**each._asdict(), "value": _plain(each.value)} for each in one.assumed],
        "assumed_host": [each.key for each in one.assumed_host],
        "left_out": list(one.left_out),
        "curve": [{"period_us": each.period_us, **_safe_record(each)} for each in one.curve],
    }


def tested_record(bus: Bus) -> Record:
    """Which parts of a kind figures of others set, which they test, and which they do not test."""
    found = parts_tested(bus.evidence_data)
    set_by, tested = map(parts_by, (found.set_by, found.parts))
    return {"set_by": set_by, "tested": tested, "not_tested": list(found.untested)}


def _head(kind: str, *, is_own: bool, why_not: list[str]) -> Record:
    bus = kind_named(kind)
    return {"kind": kind, "title": bus.title, "is_own": is_own, "why_not": why_not, **tested_record(bus)}


def _safe_record(safe: SafeAxes) -> Record:
    return dict(zip(_SAFE, (safe.nodes, safe.axes, safe.limited_by), strict=True))


def _circle_record(circle: CircleAtSmallest) -> Record:
    figures = circle.figures
    return {
        "step_us": circle.step_us,
        "passed": False if figures is None else figures.passed,
        **{key: None if figures is None else getattr(figures, key) for key in _MEASURES},
        "problems": list(circle.problems),
    }


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
