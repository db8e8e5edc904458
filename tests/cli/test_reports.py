"""The reports as processes: their documents, their options, their exit codes."""

import csv
import io
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from busplan import __version__

Run = Callable[..., Any]
Refused = Callable[..., str]


def strictly(text: str) -> Any:
    """Read one JSON document and nothing else, without the numbers that JSON does not know."""

    def no_constant(name: str) -> None:
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=no_constant)


def document(run: Run, *arguments: str) -> Any:
    done = run(*arguments, "--format", "json")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("}\n")
    return strictly(done.stdout)


def rows(run: Run, *arguments: str) -> list[dict[str, str]]:
    done = run(*arguments, "--format", "csv")
    assert (done.returncode, done.stderr) == (0, "")
    return list(csv.DictReader(io.StringIO(done.stdout, newline=""), strict=True))


def cell(value: object) -> str:
    """A JSON value as CSV has it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return " ".join(value) if isinstance(value, list) else str(value)


# --- latency ----------------------------------------------------------------------------------------------


def test_phases_add_up_to_the_latency(run: Run) -> None:
    for one in document(run, "latency", "paper-dma", "--payload", "4,5,2048")["transactions"]:
        halves = one["request_and_acknowledge_us"], one["response_and_acknowledge_us"]
        assert halves == pytest.approx(
            (one["request_us"] + one["acknowledge_us"], one["response_us"] + one["acknowledge_us"])
        )
        assert one["latency_us"] == pytest.approx(sum(halves) + one["execution_us"])


@pytest.mark.parametrize(
    "arguments",
    [
        ("latency", "paper-4ms"),
        ("latency", "paper-dma", "--payload", "4,5,2048", "--timing-model", "standard"),
        ("capacity", "paper-4ms"),
        ("capacity", "paper-1ms", "--period", "100us", "--period", "4ms", "--set", "bus.nodes=63"),
    ],
    ids=" ".join,
)
def test_csv_has_the_profile_the_keys_and_the_figures_of_json(run: Run, arguments: tuple[str, ...]) -> None:
    found = document(run, *arguments)
    of_json = found["transactions" if arguments[0] == "latency" else "results"]
    of_csv = rows(run, *arguments)
    assert [{"profile": arguments[1], **{key: cell(value) for key, value in row.items()}} for row in of_json] == of_csv
    assert list(of_csv[0]) == ["profile", *of_json[0]]


def test_latency_as_a_table_names_the_equation_of_every_row(run: Run) -> None:
    done = run("latency", "paper-4ms", "--payload", "4,16", "--all")
    assert (done.returncode, done.stderr) == (0, "")
    table_rows = re.findall(r"(?m)^(?!-|phase| ).*\d\.\d{3}.*$", done.stdout)
    assert len(table_rows) == 2 * 22  # what is 0 among them
    assert all(re.search(r"\(\d+\)|profile|idle", row) for row in table_rows)


def test_a_payload_over_the_speeds_limit_is_warned_of_and_computed(run: Run) -> None:
    done = run("latency", "paper-dma", "--payload", "4,3000")
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1] == "Warning: a payload of 3000 bytes is over the 2048 bytes of S400."


# --- capacity ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "exceeded", "limited_by"),
    [
        (("paper-4ms", "--set", "bus.nodes=1000000"), "hops nodes time", "hops"),
        (("paper-4ms", "--set", "bus.nodes=17"), "hops", "hops"),
        (("paper-4ms", "--period", "1us"), "time", "time"),
        (("paper-4ms", "--period", "1000s"), "", "hops"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_a_report_exits_0_whatever_its_verdict_is(
    run: Run, arguments: tuple[str, ...], exceeded: str, limited_by: str
) -> None:
    one = document(run, "capacity", *arguments, "--timing-model", "paper")["results"][0]
    assert set(one["exceeded"]) == set(exceeded.split())
    assert one["fits"] is (not exceeded)
    assert one["limited_by"] == limited_by


def test_a_payload_over_the_limit_loads_and_leaves_no_node(run: Run) -> None:
    found = run("capacity", "-", "--format", "json", stdin=profile_text(read_bytes="2049"))
    assert (found.returncode, found.stderr) == (0, "")
    one = strictly(found.stdout)["results"][0]
    assert (one["max_nodes"], one["max_axes"], one["limited_by"], one["fits"]) == (0, 0, "payload", False)


def test_what_moves_the_margin_is_asked_for(run: Run) -> None:
    (plain,) = verdicts(run, "paper-4ms")
    assert not {"sensitivity", "next_bottleneck"} & set(plain)
    # Each change is one that an option makes.
    (verdict,) = verdicts(run, "paper-4ms", "--sensitivity", "--period", "600us", "--set", "bus.gap_count=8")
    rows = {one["change"]: one for one in verdict["sensitivity"]}
    for change, *keys in (
        ("one more node", "bus.nodes=3", "bus.gap_count=8"),
        ("a bus reset", "bus.gap_count=63"),
        ("host time +10 us", "bus.gap_count=8", "host.transaction_us=10"),
    ):
        (other,) = verdicts(run, "paper-4ms", "--period", "600us", *(f"--set={key}" for key in keys))
        for key in ("margin_corrected_us", "uncertainty_us", "verdict", "gap_count_safe"):
            assert rows[change][key] == other[key]
        difference_us = other["margin_corrected_us"] - verdict["margin_corrected_us"]
        assert rows[change]["margin_change_us"] == pytest.approx(difference_us)
    said = run("capacity", "paper-1ms", "--sensitivity", "--set", "bus.gap_count=7").stdout
    (reset,) = (line.split() for line in said.splitlines() if line.startswith("a bus reset") and "->" in line)
    assert reset[3:] == ["7", "->", "63", "-66", "230", "fits"]


def test_capacity_as_a_table_begins_with_the_verdict(run: Run) -> None:
    done = run("capacity", "paper-4ms")
    assert (done.returncode, done.stderr) == (0, "")
    head, bar, *lines = done.stdout.partition("\n\n")[0].splitlines()
    assert re.fullmatch(r"paper-4ms  IEEE 1394, 2 nodes, 8 axes, 4 ms +FITS", head)
    assert re.fullmatch(r"  \[#+\.+\| +\]", bar)
    answer = {line[2:17].strip(): line[18:] for line in lines}
    whole = run("capacity", "paper-4ms", "--all").stdout
    details = [line for line in whole.partition("\n\n")[0].splitlines()[2:] if line not in lines]
    assert [line[2:17].strip() for line in details] == ["correction", "checked against"]
    answer |= {line[2:17].strip(): line[18:] for line in details}
    assert answer["used"].startswith("270 us of the 2000 that the bus may use, 13 %")
    assert answer["free"] == "1730 us, +/- 6"
    assert answer["room for"] == "11 more nodes: 13 nodes, 52 axes in all"
    assert answer["rests on"].startswith("an instant host, cycles without jitter")
    # These lines are the answer in the document, too.
    assert answer == {one["label"]: one["text"] for one in verdicts(run, "paper-4ms")[0]["lines"]}
    assert "(4)" not in done.stdout
    assert "(4)" in whole


def test_the_papers_equations_are_said_to_disagree_and_decide_nothing(run: Run) -> None:
    done = run("capacity", "paper-4ms", "--period", "500us")
    assert done.returncode == 0
    assert "  short by        20 us, +/- 6\n" in done.stdout
    assert "  paper model     fits: 207 us of 250; the standard model decides\n" in done.stdout
    assert not any(verdict["models_agree"] for verdict in verdicts(run, "paper-4ms", "--period", "500us"))


def verdicts(run: Run, *arguments: str) -> Any:
    return document(run, "capacity", *arguments)["verdicts"]


# --- the other commands -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_evidence_has_the_papers_part_and_what_else_is_known(run: Run) -> None:
    done = run("evidence", "ieee1394", "--all")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout in run("evidence", "--all").stdout
    assert run("paper", "--all").stdout in done.stdout
    # Without --all: what was tested of each kind; of one kind how far the figures of each source are apart.
    assert "residual" not in run("evidence").stdout
    short = run("paper").stdout
    assert re.search(r"\nTable I: T1\+T2, theory +eq \(15\) +8 +-0\.1 +\+0\.1\n", short)
    assert "\nNot shown: each figure. --all shows all.\n" in short
    found, paper = document(run, "evidence", "ieee1394")["figures"], document(run, "paper")["figures"]
    assert {one["data"] for one in found} == {"paper", "dvrk", "ieee1394"}
    assert [one for one in found if one["data"] == "paper"] == [
        {**one, "kind": "ieee1394", "data": "paper"} for one in paper
    ]
    theory = [one for one in paper if one["method"] == "eq (15)"]
    assert len(theory) == 8
    for one in theory:
        assert f"{one['computed']:.2f}" == f"{one['published']:.2f}"
        assert one["residual"] == pytest.approx(one["computed"] - one["published"])
    refused = run("evidence", "can-opener")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.startswith("can-opener: no such kind of bus; there are ieee1394, can")


def test_profiles_lists_what_every_command_takes_by_name(run: Run) -> None:
    done = run("profiles")
    assert (done.returncode, done.stderr) == (0, "")
    found = document(run, "profiles")
    names = [one["name"] for one in found["profiles"]]
    assert names == sorted(path.stem for path in (Path(__file__).parents[2] / "profiles").glob("*.toml"))
    assert [line.split()[0] for line in done.stdout.splitlines()[3:]] == names
    assert all(one["description"] in run("profiles", "--all").stdout for one in found["profiles"])
    assert all(math.isfinite(one["period_us"]) for one in found["profiles"])


def test_version_and_help_go_to_stdout(run: Run) -> None:
    version = run("--version")
    assert (version.returncode, version.stdout, version.stderr) == (0, f"busplan {__version__}\n", "")
    for arguments in (("--help",), ("-h",)):
        done = run(*arguments)
        assert (done.returncode, done.stderr) == (0, "")
        assert all(
            f"\n  {command}  " in done.stdout for command in ("latency", "capacity", "paper", "profiles", "init")
        )
        assert (
            "Exit codes: 0 done, 1 the answer is no (findings, no plan, a circle that fails), 2 could not"
            in " ".join(done.stdout.split())
        )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "Usage: busplan [OPTIONS] COMMAND"),
        (("nope",), "nope: no such command; `busplan --help` lists them"),
        (("capcity", "paper-4ms"), "capcity: no such command; did you mean capacity?"),
        (("capacity", "paper-4ms", "--perod", "1ms"), "no such option: --perod (Possible options: --period)"),
        (("capacity", "paper-4ms", "--period"), "option '--period' requires an argument"),
        (("capacity",), "busplan capacity: missing argument 'PROFILE'; `busplan capacity --help` says more"),
        (("rule", "bp30"), "bp30: no such rule; did you mean BP301? `busplan rule` lists them"),
        (("manual", "plam"), "; did you mean plan?"),
        (("capacity", "gantry"), "; did you mean gantry-24?"),
        (("capacity", "paper-4ms", "paper-1ms"), "unexpected extra argument"),
        (("plan", "paper-4ms", "--nodes", "two"), "--nodes two: expected a whole number; "),
        (
            ("capacity", "paper-4ms", "--timing-model", "neither"),
            "--timing-model 'neither': expected 'standard' or 'paper', or a list of them, each once",
        ),
        (
            ("latency", "paper-4ms", "--format", "xml"),
            "--format xml: expected table, markdown, html, csv or json; ",
        ),
        (
            ("latency", "paper-4ms", "--gap-count", "7"),
            "busplan latency: no such option: --gap-count; --set bus.gap_count=... changes it for this run",
        ),
        (
            ("capacity", "paper-4ms", "--timing", "paper"),
            "no such option: --timing (Possible options: --timing-model); ",
        ),
        (
            ("circle-test", "paper-4ms", "--feed", "9"),
            "no such option: --feed; --set circle.feed_mm_per_min=... changes",
        ),
        (("schema", "--nodes", "9"), "no such option: --nodes; `busplan schema --help` says more"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_wrong_usage_exits_2_with_nothing_on_stdout(refused: Refused, arguments: tuple[str, ...], said: str) -> None:
    told = refused(*arguments)
    assert said.casefold() in told.casefold()
    # One line in one form, whoever finds the error.
    assert not arguments or re.fullmatch(r"\S.*: .*[^.\n]", told)


def test_a_file_whose_ending_is_left_out_is_asked_for(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "line.toml").write_text("", encoding="utf-8")
    assert refused("capacity", "line", cwd=tmp_path) == "line: no such file; did you mean line.toml?"
    assert refused("capacity", "./line", cwd=tmp_path) == "./line: no such file; did you mean ./line.toml?"
    assert "did you mean" not in refused("capacity", "rail", cwd=tmp_path)


def test_two_wrong_options_are_told_at_once(refused: Refused) -> None:
    said = refused("capacity", "paper-4ms", "--set", "bus.nodes=0", "--set", "bus.gap_count=64").splitlines()
    assert sorted(line.partition(":")[0] for line in said) == ["--set bus.gap_count=64", "--set bus.nodes=0"]


# --- profiles of one's own --------------------------------------------------------------------------------


def profile_text(*, name: str = '"mine"', read_bytes: str = "12") -> str:
    return f"""\
schema_version = 1
name = {name}
bus = {{ kind = "ieee1394", speed = "S400", nodes = 2 }}
cycle.period_us = 4000
payload = {{ read_bytes = {read_bytes}, write_bytes = 12 }}
node = {{ axes = 4, execution = {{ kind = "linear", base_us = 30, per_byte_us = 0.35 }} }}
"""


def test_a_profile_comes_from_a_file_with_the_same_answer(run: Run, tmp_path: Path) -> None:
    (tmp_path / "größe x.toml").write_text(profile_text(), encoding="utf-8")
    done = run("capacity", "größe x.toml", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout == run("capacity", "-", stdin=profile_text()).stdout


NAMES = ["[bold]x[/] [/] :smile:", "[link=file:///etc]x[/link]", "a \"b\" 'c' größe 日本 \U0001f600", "%s {0} \\n"]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_shown_as_written(run: Run, name: str) -> None:
    text = profile_text(name=json.dumps(name, ensure_ascii=False))
    for command in ("capacity", "latency"):
        assert name in run(command, "-", stdin=text).stdout
    found = strictly(run("capacity", "-", "--format", "json", stdin=text).stdout)
    assert found["profile"] == name
    assert name in found["verdicts"][0]["text"]
