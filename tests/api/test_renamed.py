"""Old names work for one release, with a warning; parameters and options have one name."""

import inspect
import re
from collections.abc import Callable
from typing import Any

import pytest
import typer

import busplan
from busplan.api.answer import Answer
from busplan.cli import app

OLD: dict[str, tuple[Callable[[], Answer], Callable[[], Answer]]] = {
    "periods_us of busplan.capacity is now called period_us": (
        lambda: busplan.capacity("paper-4ms", periods_us=[2000]),  # type: ignore[call-arg]
        lambda: busplan.capacity("paper-4ms", period_us=2000),
    ),
    "timing_models of busplan.capacity is now called timing_model": (
        lambda: busplan.capacity("paper-4ms", timing_models=["paper"]),  # type: ignore[call-arg]
        lambda: busplan.capacity("paper-4ms", timing_model="paper"),
    ),
    "payloads_bytes of busplan.latency is now called payload_bytes": (
        lambda: busplan.latency("paper-4ms", payloads_bytes=[16]),  # type: ignore[call-arg]
        lambda: busplan.latency("paper-4ms", payload_bytes=16),
    ),
    "with_contributions of busplan.circle_test is now called contributions": (
        lambda: busplan.circle_test("paper-optimal-gap", with_contributions=True),  # type: ignore[call-arg]
        lambda: busplan.circle_test("paper-optimal-gap", contributions=True),
    ),
    "with_circle of busplan.sweep is now called circle": (
        lambda: busplan.sweep("paper-4ms", vary={"bus.nodes": [1]}, with_circle=False),  # type: ignore[call-arg]
        lambda: busplan.sweep("paper-4ms", vary={"bus.nodes": [1]}, circle=False),
    ),
    "busplan.trade_off is now called busplan.map_": (
        lambda: busplan.trade_off("paper-4ms", x={"axes": [4]}),
        lambda: busplan.map_("paper-4ms", x={"axes": [4]}),
    ),
}


@pytest.mark.parametrize("said", OLD)
def test_an_old_name_works_and_warns_where_it_stands(said: str) -> None:
    old, new = OLD[said]
    with pytest.warns(DeprecationWarning, match=re.escape(said)) as warned:
        found = old()
    assert found.to_dict() == new().to_dict()
    assert [one.filename for one in warned] == [__file__]


def test_an_old_type_is_the_new_one() -> None:
    with pytest.warns(DeprecationWarning, match=r"busplan\.TradeOffAnswer is now called busplan\.MapAnswer"):
        assert busplan.TradeOffAnswer is busplan.MapAnswer
    assert not {"trade_off", "TradeOffAnswer"} & set(busplan.__all__)


def test_both_names_at_once_are_refused() -> None:
    with pytest.raises(TypeError, match=r"capacity\(\) got period_us twice, once by its old name periods_us"):
        busplan.capacity("paper-4ms", period_us=500, periods_us=[500])  # type: ignore[call-arg]


# --- one name for one thing -------------------------------------------------------------------------------

OF_THE_COMMAND = {"all", "format", "output", "set", "jobs", "help"}
"""Options that say where and what to write, the processes, or change the profile, which load_profile(changes=) does."""
ALONE = {
    "calibrate": {"apply", "nodes", "gap-count"},
    "check": {"set", "annotate", "baseline", "update-baseline", "require-baseline", "prefix", "no-shipped"},
    "circle-test": {"plot", "trace", "feed", "radius", "every", "nodes", "gap-count", "direction", "seed"},
    "diff": {"fail-on-regression", "tolerance"},  # both are answer.regressions(tolerance_percent=)
    "plan": {"apply", "force"},
    "sweep": {"columns", "sort", "top", "plot", "figure", "resume", "cluster"},  # cluster is executor=
}
"""Options without a parameter."""
SHORT_FORMS = {"period", "nodes", "gap-count"}
SUFFIXES = ("", "_us", "_bytes", "_model", "_percent", "_mm", "_mm_per_min")


def options(command: str) -> set[str]:
    group = typer.main.get_command(app)
    found = group.get_command(None, command)  # type: ignore[attr-defined]
    return {name.lstrip("-") for one in found.params for name in one.opts if name.startswith("--")}


@pytest.mark.parametrize(
    "name",
    [
        "calibrate",
        "capacity",
        "circle_test",
        "compare",
        "diff",
        "explain",
        "latency",
        "map_",
        "plan",
        "report",
        "sweep",
        "timeline",
    ],
)
def test_a_parameter_is_called_as_its_option(name: str) -> None:
    command = name.rstrip("_").replace("_", "-")
    function: Callable[..., Any] = getattr(busplan, name)
    own = set(inspect.signature(function).parameters)
    asked = options(command) - OF_THE_COMMAND - ALONE.get(command, set())
    missing = {one for one in asked if not {one.replace("-", "_") + suffix for suffix in SUFFIXES} & own}
    assert missing <= SHORT_FORMS, missing
    named = {
        one for one in own if any(one == f"{option.replace('-', '_')}{end}" for option in asked for end in SUFFIXES)
    }
    assert own - named <= {"profile", "profiles", "a", "b", "figure", "measurements", "progress", "executor"}
