"""`busplan compare` through the command line: each form, options, refusals."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import busplan
from busplan.buses import kind_names

if TYPE_CHECKING:
    import subprocess

Run = Callable[..., "subprocess.CompletedProcess[str]"]
Refused = Callable[..., str]


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("c.txt", b"paper-4ms at 4 ms: shown to fit on "),
        ("c.md", b"### `paper-4ms` on each kind of bus"),
        ("c.html", b"<!DOCTYPE html>"),
        ("c.csv", b"profile,kind,title,is_own,"),
        ("c.json", b'{\n  "schema": 1,\n  "command": "compare",'),
        ("c.svg", b'<svg xmlns="http://www.w3.org/2000/svg" class="chart"'),
        ("c.png", b"\x89PNG"),
    ],
)
def test_the_ending_of_the_file_chooses_the_form(busplan: Run, tmp_path: Path, name: str, start: bytes) -> None:
    done = busplan("compare", "paper-4ms", "-o", name, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", f"wrote {name}\n")
    assert (tmp_path / name).read_bytes().startswith(start)


def test_a_picture_goes_down_a_pipe(run: Run, tmp_path: Path) -> None:
    with (tmp_path / "pipe").open("wb") as file:
        done = run("compare", "paper-4ms", "--format", "png", inside={"stdout": file.fileno()})
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "pipe").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["gantry-24", "can-servo-8", "paper-1ms", "dvrk"])
def test_a_report_exits_0_and_has_every_kind(run: Run, name: str) -> None:
    done = run("compare", name, *(["--circle"] if name == "paper-1ms" else []), "--format", "json")
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout, parse_constant=pytest.fail)
    assert {one["kind"] for one in document["buses"]} == set(kind_names())
    assert document["buses"][0]["kind"] == document["kind"] == busplan.load_profile(name).bus.kind
    for one in document["buses"]:
        if one["smallest_period_us"] is None:
            assert one["no_period"] or one["why_not"]
            assert one["circle"] is None
        elif document["with_circle"]:
            steps = one["smallest_period_us"] / one["circle"]["step_us"]
            assert steps == pytest.approx(round(steps), abs=1e-9)


def test_the_circle_says_its_step(run: Run) -> None:
    first, *_ = (
        line
        for line in run("compare", "paper-1ms", "--buses", "ieee1394", "--circle").stdout.splitlines()
        if "as it is" in line
    )
    assert first.split()[-2:] == ["PASSED", "92.082"]
    assert "PASSED" not in run("compare", "paper-1ms").stdout


def test_options_change_the_profile_before_it_is_put_on_other_kinds(run: Run) -> None:
    options = ("--set", "bus.nodes=3", "--period", "2ms", "--set", "bus.speed=S200", "--set", "node.axes=2")
    done = run("compare", "paper-1ms", "--buses", "can", *options, "--format", "json")
    document = json.loads(done.stdout)
    assert document["changes"] == {"bus.nodes": 3, "bus.speed": "S200", "node.axes": 2}
    assert (document["period_us"], document["nodes"], document["axes"]) == (2000, 3, 6)
    assert "bus.speed" in document["buses"][0]["left_out"]
    said = run("compare", "paper-1ms", *options).stdout.splitlines()
    assert said[0] == "With --set bus.nodes=3 and --set bus.speed=S200 and --set node.axes=2."
    assert said[1].startswith("paper-1ms at 2 ms: ")


def test_kinds_come_in_the_order_asked_for_and_once(run: Run) -> None:
    done = run("compare", "paper-1ms", "--buses", "can, ieee1394,can", "--format", "json")
    assert [one["kind"] for one in json.loads(done.stdout)["buses"]] == ["can", "ieee1394"]


def test_what_cannot_be_is_refused(refused: Refused, tmp_path: Path) -> None:
    said = refused("compare", "paper-1ms", "--buses", "can,iee1394")
    assert said.startswith("--buses iee1394: no kind of bus; there are ieee1394, ")
    assert said.endswith("did you mean ieee1394?")
    assert "no kind of bus" in refused("compare", "paper-1ms", "--buses", "")
    assert "no such file" in refused("compare", "nowhere")
    assert "--set bus.bit_rate_kbit_s=500" in refused("compare", "paper-1ms", "--set", "bus.bit_rate_kbit_s=500")
    assert "expected a name ending in" in refused("compare", "paper-1ms", "-o", "x.pdf", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_is_read_is_not_overwritten(refused: Refused, tmp_path: Path) -> None:
    text = Path(busplan.__file__).parents[2].joinpath("profiles", "paper-1ms.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    for ending in ("svg", "json"):
        (tmp_path / f"own.{ending}").symlink_to("own.toml")
        assert "would overwrite own.toml" in refused("compare", "own.toml", "-o", f"own.{ending}", cwd=tmp_path)
