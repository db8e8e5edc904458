"""Each answer's document is the one that the command writes with `--format json`."""

import json
import re
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest
from typer.testing import CliRunner

import busplan
from busplan.cli import app
from busplan.manual import page, topics

# One of each other class of bus, and one of groups.
OTHERS = ("dvrk", "can-servo-8", "ethercat-servo-8", "sercos3-servo-8")
EVERY: dict[str, Callable[[str], Any]] = {
    "latency": busplan.latency,
    "capacity": busplan.capacity,
    "circle-test": busplan.circle_test,
    "plan": busplan.plan,
    "timeline": busplan.timeline,
    "check": busplan.check,
    "map": busplan.map_,
    "compare --buses can,ieee1394": lambda profile: busplan.compare(profile, buses=["can", "ieee1394"]),
    "explain": busplan.explain,
    "report --no-circle": lambda profile: busplan.report(profile, circle=False),
}
OPTIONS: dict[str, Callable[[], Any]] = {
    "latency paper-4ms --payload 4,16 --timing-model standard": lambda: busplan.latency(
        "paper-4ms", payload_bytes=[4, 16], timing_model=["standard"]
    ),
    "latency paper-4ms --set bus.nodes=5 --set bus.gap_count=optimal": lambda: busplan.latency(
        busplan.load_profile("paper-4ms", changes={"bus.nodes": 5, "bus.gap_count": "optimal"})
    ),
    "capacity paper-1ms --period 600us --period 0.25ms --timing-model paper": lambda: busplan.capacity(
        "paper-1ms", period_us=[600, 250], timing_model="paper"
    ),
    "circle-test paper-1ms --set circle.radius_mm=20 --period 1ms --period 100us --contributions": lambda: (
        busplan.circle_test(
            busplan.load_profile("paper-1ms", changes={"circle.radius_mm": 20.0}),
            period_us=[1000, 100],
            contributions=True,
        )
    ),
    "plan paper-1ms --nodes 6 --period 500us --set bus.gap_count=63": lambda: busplan.plan(
        "paper-1ms", nodes=6, period_us=500, changes={"bus.gap_count": 63}
    ),
    "plan paper-1ms --axes 15 --set limits.reserve=0.125 --free responses,gap_count": lambda: busplan.plan(
        "paper-1ms", axes=15, changes={"limits.reserve": 0.125}, free=["gap_count", "responses"]
    ),
    "plan paper-1ms --axes 9 --set node.axes=3 --set bus.speed=S200": lambda: busplan.plan(
        "paper-1ms", axes=9, changes={"node.axes": 3, "bus.speed": "S200"}
    ),
    "timeline paper-1ms --timing-model standard --from 50us --to 0.1ms": lambda: busplan.timeline(
        "paper-1ms", timing_model="standard", from_us=50, to_us=100
    ),
    "map paper-1ms --x axes=4:16:4 --y bus.gap_count=7,63,optimal": lambda: busplan.map_(
        "paper-1ms", x={"axes": range(4, 17, 4)}, y={"bus.gap_count": [7, 63, "optimal"]}
    ),
    "compare can-servo-8 --buses can,ieee1394": lambda: busplan.compare("can-servo-8", buses=["can", "ieee1394"]),
    "compare paper-1ms --buses can --set bus.nodes=3": lambda: busplan.compare(
        busplan.load_profile("paper-1ms", changes={"bus.nodes": 3}), buses="can"
    ),
    "timeline paper-1ms --transaction write:2": lambda: busplan.timeline("paper-1ms", transaction=("write", 2)),
    "check paper-4ms nowhere.toml --no-circle": lambda: busplan.check(["paper-4ms", "nowhere.toml"], circle=False),
    "sweep paper-4ms --vary cycle.period_us=125:1000:*2 --timing-model paper": lambda: busplan.sweep(
        "paper-4ms", vary={"cycle.period_us": "125:1000:*2"}, timing_model="paper"
    ),
    "sweep paper-4ms --vary circle.radius_mm=10,20 --vary cycle.period_us=200,4000 --circle --jobs 1": lambda: (
        busplan.sweep("paper-4ms", vary={"circle.radius_mm": [10, 20], "cycle.period_us": [200.0, 4000.0]}, circle=True)
    ),
    "sweep paper-1ms --vary bus.nodes=1:4 --vary bus.gap_count=63,optimal": lambda: busplan.sweep(
        "paper-1ms", vary={"bus.nodes": range(1, 5), "bus.gap_count": [63, "optimal"]}
    ),
    "diff paper-1ms paper-optimal-gap": lambda: busplan.diff("paper-1ms", "paper-optimal-gap"),
    "diff paper-4ms paper-dma --timing-model standard": lambda: busplan.diff(
        "paper-4ms", "paper-dma", timing_model="standard"
    ),
    "explain paper-4ms required_us --period 1ms --period 500us --timing-model both": lambda: busplan.explain(
        "paper-4ms", "required_us", period_us=[1000, 500], timing_model=["standard", "paper"]
    ),
    "explain paper-4ms latency.latency_us --transaction read --timing-model standard": lambda: busplan.explain(
        "paper-4ms", "latency.latency_us", transaction="read", timing_model="standard"
    ),
    "evidence can": lambda: busplan.evidence("can"),
    "paper": lambda: busplan.evidence(paper=True),
    "calibrate paper-two-node table-1.csv --timing-model paper": lambda: busplan.calibrate(
        "paper-two-node", "table-1.csv", timing_model="paper"
    ),
    "report sercos2-servo-8 sercos3-servo-8 --set bus.nodes=3 --no-circle --title Two": lambda: busplan.report(
        [busplan.load_profile(name, changes={"bus.nodes": 3}) for name in ("sercos2-servo-8", "sercos3-servo-8")],
        circle=False,
        title="Two",
    ),
}


def printed(line: str) -> Any:
    done = CliRunner().invoke(app, [*line.split(), "--format", "json"], prog_name="busplan")
    assert done.stdout, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("command", "name"),
    # What command and function do alike does not hang on the bus: every bus is asked of some.
    list(zip(EVERY, cycle(("paper-1ms", *OTHERS)), strict=False)),
)
def test_of_every_class_of_bus(command: str, name: str) -> None:
    first, *rest = command.split(" ", 1)
    assert EVERY[command](name).to_dict() == printed(" ".join((first, name, *rest)))


@pytest.mark.slow
@pytest.mark.parametrize("line", OPTIONS)
def test_with_the_options_of_the_command(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    document = printed(line)
    # In Python the changes are the profile's.
    if "--set" in line and not line.startswith("report"):
        document.pop("changes", None)
    assert OPTIONS[line]().to_dict() == document


@pytest.mark.parametrize("name", ["latency", "capacity", "plan", "timeline"])
def test_the_text_is_what_the_command_prints(
    run: Callable[..., CompletedProcess[str]], name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    answer = EVERY[name]("sercos3-servo-8")
    printed = run(name, "sercos3-servo-8").stdout.replace("--all shows all.", "to_dict() has all figures.")
    assert f"{answer}\n" == printed
    assert capfd.readouterr() == ("", "")


def keys_of(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        yield from document
    inside = document.values() if isinstance(document, dict) else document if isinstance(document, list) else ()
    for value in inside:
        yield from keys_of(value)


def test_the_manual_or_the_registered_figures_have_each_key() -> None:
    tight = {"tolerance.max_contour_error_mm": 1e-9}
    documents = [
        busplan.capacity("paper-4ms", sensitivity=True).to_dict(),
        busplan.compare("gantry-24", buses=["ieee1394", "can"]).to_dict(),
        busplan.plan("paper-1ms", nodes=62, free=["gap_count"]).to_dict(),  # impossible
        busplan.circle_test(busplan.load_profile("paper-1ms", changes=tight)).to_dict(),
    ]
    figures = {row["figure"] for row in busplan.explain("paper-4ms").to_dict()["figures"]}
    pages = "".join(map(page, topics()))
    named = set(re.findall(r"[\w.]+", " ".join(re.findall(r"`([^`\n]+)`", pages))))
    unknown = {key for key in keys_of(documents) if "." not in key} - named - figures
    assert not unknown
