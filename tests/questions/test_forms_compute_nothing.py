"""An answer is complete when it is returned: no form of it asks a bus, the fit, the search or the servo again.

A form may read the profile and what a record says of itself, and ask what a figure is called and which unit it has.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from inspect import Parameter, isfunction, signature
from pathlib import Path
from pkgutil import walk_packages
from types import CodeType, FrameType
from typing import Any

import pytest

import busplan
from busplan.buses.bus import Bus
from busplan.buses.network import Network
from busplan.errors import BusplanError
from busplan.gate.formats import FORMATS
from busplan.questions.fit.figures import CycleFigures

COMPUTE = ("busplan.buses", "busplan.questions.fit", "busplan.servo")
REGISTERS = ("busplan.buses", "busplan.buses.figure")
"""Names of the kinds of bus, and of figures."""
FILES = Path(__file__).parents[1] / "questions" / "import_" / "files"
TABLE = Path(__file__).parents[2] / "profiles" / "table-1.csv"
KINDS = ("gantry-24", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8", "profibus-drives-6")
TIGHT = {"cycle.period_us": 300, "limits.reserve": 0.1, "limits.min_spare_nodes": 9}
AGAIN = {"to_json", "svg", "to_pandas", "to_polars", "to_xarray"}
"""What is part of another form, or what another library makes of the same columns."""
ENDINGS = (".md", ".csv", ".parquet", ".log", ".pcapng")
X, Y = {"limits.reserve": [0, 0.3]}, {"cycle.period_us": [500, 1000]}


def machines(*names: str) -> Iterator[tuple[str, busplan.Profile]]:
    """Some shipped profiles, and those with most to say with a period that is too short, too."""
    for name in names:
        yield name, busplan.load_profile(name)
        if name in KINDS[:2]:
            yield f"{name}, tight", busplan.load_profile(name, changes=TIGHT)


def recorded(profile: busplan.Profile, folder: Path) -> busplan.MeasuredAnswer:
    """What a recording of an emulated machine shows."""
    path = folder / f"recording.{'log' if profile.bus.kind == 'can' else 'pcapng'}"
    busplan.emulate(profile, cycles=20).save(path)
    return busplan.measured(profile, path)


def beside(profile: busplan.Profile, folder: Path) -> busplan.RecordedTimelineAnswer:
    """A cycle of such a recording."""
    recorded(profile, folder)
    return busplan.timeline(profile, recording=next(folder.glob("recording.*")))


def alone(profile: busplan.Profile, folder: Path) -> busplan.RecordedAnswer:
    """What its log has without a plan."""
    recorded(profile, folder)
    return busplan.recorded(folder / "recording.log")


Ask = Callable[[busplan.Profile, Path], Any]
QUESTIONS: dict[str, tuple[Ask, tuple[str, ...]]] = {
    "calibrate": (lambda profile, _: busplan.calibrate(profile, TABLE), ("paper-1ms",)),
    "capacity": (lambda profile, _: busplan.capacity(profile, period_us=[500, 1000], sensitivity=True), KINDS),
    "check": (lambda profile, _: busplan.check(profile, circle=False), KINDS),
    "circle_test": (lambda profile, _: busplan.circle_test(profile, contributions=True), ("paper-1ms",)),
    "compare": (lambda profile, _: busplan.compare(profile), ("paper-1ms",)),
    "diff": (lambda profile, _: busplan.diff(profile, "gantry-24"), KINDS),
    "emulate": (lambda profile, _: busplan.emulate(profile, cycles=20), ("can-servo-8",)),
    "evidence": (lambda profile, _: busplan.evidence(profile.bus.kind), ("can-servo-8",)),
    "explain": (lambda profile, _: busplan.explain(profile), KINDS),
    "explore": (lambda profile, _: busplan.explore(profile, x=X, y=Y, over={"cycle.retries": [0, 1]}), ("paper-1ms",)),
    "import_profile": (lambda _, __: busplan.import_profile([FILES / "machine.dbc"]), ("can-servo-8",)),
    "latency": (lambda profile, _: busplan.latency(profile), KINDS),
    "map_": (lambda profile, _: busplan.map_(profile, x=X, y=Y), KINDS),
    "measured": (recorded, ("can-servo-8", "can-motors-8", "ethercat-servo-8")),
    "plan": (lambda profile, _: busplan.plan(profile, free=["period"]), KINDS),
    "recorded": (alone, ("can-servo-8",)),
    "report": (lambda profile, _: busplan.report(profile, circle=False), ("paper-1ms",)),
    "sweep": (lambda profile, _: busplan.sweep(profile, vary=Y), KINDS),
    "timeline": (lambda profile, _: busplan.timeline(profile), KINDS),
}
"""Each question, and the machines that it is asked of."""
BESIDE = {"timeline of a recording": (beside, ("can-servo-8", "ethercat-servo-8", "can-motors-8"))}
ASKED = [
    pytest.param(ask, profile, id=f"{question} {name}")
    for question, (ask, names) in {**QUESTIONS, **BESIDE}.items()
    for name, profile in machines(*names)
]


def test_no_question_is_missing() -> None:
    assert {name for name in busplan.__all__ if name.islower()} - {"__version__", "load_profile"} == QUESTIONS.keys()


def forms(answer: Any, folder: Path) -> Iterator[Callable[[], Any]]:
    """All that an answer gives without being told more, what a notebook shows, and files of further forms."""
    names = {name for name in dir(type(answer)) if not name.startswith("_")} - AGAIN
    yield from (partial(given, answer, name) for name in (*names, "_repr_html_", "_repr_svg_"))
    yield from (partial(show, answer) for show in (str, repr))
    yield from (partial(answer.save, folder / f"answer{ending}") for ending in ENDINGS)
    if isinstance(answer, busplan.CheckAnswer):
        yield from (partial(form.write, answer) for form in FORMATS.values())


def given(answer: Any, name: str) -> None:
    """Ask for an attribute, and call it if it can do without arguments."""
    value = getattr(answer, name)
    if callable(value) and not any(one.default is Parameter.empty for one in signature(value).parameters.values()):
        value()


def reads(records: set[type]) -> set[CodeType]:
    """What records say of themselves: their properties, and their methods without arguments."""
    members = [member for kind in records for base in kind.__mro__ for member in vars(base).values()]
    functions = [member.fget if isinstance(member, property) else member for member in members]
    codes = {one.__code__ for one in functions if isfunction(one) and one.__code__.co_argcount == 1}
    says_which: Any = CycleFigures.of
    codes.add(says_which.__func__.__code__)
    return codes | {part for code in codes for part in code.co_consts if isinstance(part, CodeType)}


def calls(draw: Callable[[], Any], allowed: set[CodeType]) -> set[str]:
    """The functions that compute, of those that are called."""
    called = set()

    def seen(frame: FrameType, event: str, _: Any) -> None:
        if event != "call" or not (room := frame.f_globals.get("__name__", "")).startswith(COMPUTE):
            return
        is_register = room in REGISTERS or room.endswith("section")
        if not is_register and frame.f_code not in allowed:
            called.add(f"{room}.{frame.f_code.co_qualname}")

    sys.setprofile(seen)
    try:
        with suppress(BusplanError):  # a form that it does not have
            draw()
    finally:
        sys.setprofile(None)
    return called


@pytest.fixture(scope="module", autouse=True)
def _all_modules() -> None:
    """A module that is loaded late calls its own functions."""
    for module in walk_packages(busplan.__path__, "busplan."):
        if not module.name.endswith("__main__"):
            import_module(module.name)


def held(value: Any) -> Iterator[type]:
    """The types of a record and of all that it holds."""
    yield type(value)
    parts: Any = ()
    if is_dataclass(value):
        parts = [getattr(value, field.name) for field in fields(value)]
    elif isinstance(value, tuple | list):
        parts = value
    elif isinstance(value, dict):
        parts = value.values()
    for part in parts:
        yield from held(part)


@pytest.mark.slow
@pytest.mark.parametrize(("ask", "profile"), ASKED)
def test_forms_compute_nothing(ask: Ask, profile: busplan.Profile, tmp_path: Path) -> None:
    answer = ask(profile, tmp_path)
    records = set(held(answer))
    assert not {kind for kind in records if issubclass(kind, (Network, Bus))}
    allowed = reads({kind for kind in records if issubclass(kind, tuple) or is_dataclass(kind)})
    assert set().union(*(calls(draw, allowed) for draw in forms(answer, tmp_path))) == set()
