"""The profiles that come with busplan: how they are found, what they hold, and how a new one is made of them."""

import difflib
import tomllib
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan import BusplanError

Run = Callable[..., Any]
FOLDER = Path(__file__).parents[2] / "profiles"
SHIPPED = sorted(path.stem for path in FOLDER.glob("*.toml"))
NAMES = ["paper-1ms", "paper-4ms", "paper-dma", "paper-optimal-gap", "paper-two-node"]

# Table I, experiment, as printed: payload in bytes, T_lant and T1+T2 in us.
TABLE_1 = [
    (4, "48.7", "6"),
    (16, "48.9", "6.3"),
    (32, "57.9", "6.6"),
    (64, "68.1", "7.5"),
    (128, "99.9", "9.1"),
    (256, "158.5", "11.5"),
    (512, "246.0", "16.9"),
    (1024, "460.0", "27.4"),
]


SCHEMA_LINE = "#:schema ./busplan.schema.json\n"


def text_of(name: str) -> str:
    return (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def load(name: str) -> Any:
    return busplan.load_profile(name)


def test_a_shipped_profile_loads_under_its_own_name() -> None:
    assert set(NAMES) <= set(SHIPPED)
    for name in SHIPPED:
        assert load(name) == load(str(FOLDER / f"{name}.toml"))
        assert load(name).name == name
        assert load(name).description.strip()


def test_a_file_beside_is_meant_by_its_near_name(tmp_path: Path) -> None:
    (tmp_path / "press.toml").touch()
    for typed, meant in (("pres.toml", "press.toml"), ("prss", "press.toml"), ("press", "press.toml")):
        with pytest.raises(BusplanError) as caught:
            load(str(tmp_path / typed))
        assert str(caught.value) == f"{tmp_path / typed}: no such file; did you mean {tmp_path / meant}?"


def test_a_file_without_its_ending_is_meant_before_a_shipped_profile(work: Path) -> None:
    def refused(name: str) -> str:
        with pytest.raises(BusplanError) as caught:
            load(name)
        return str(caught.value)

    assert refused("paper-4m").endswith("; did you mean paper-4ms?")
    (work / "paper-4m.toml").touch()
    assert refused("paper-4m") == "paper-4m: no such file; did you mean paper-4m.toml?"


def test_a_shipped_profile_explains_its_keys() -> None:
    for name in SHIPPED:
        assert text_of(name).count("#") >= 5
        assert text_of(name).isascii()


def test_the_profiles_of_the_experiment_differ_in_their_period_and_in_words_only() -> None:
    slow, fast = load("paper-4ms"), load("paper-1ms")
    assert (slow.cycle.period_us, fast.cycle.period_us) == (4000, 1000)
    assert slow.bus == fast.bus
    assert slow.payload == fast.payload
    assert slow.node == fast.node
    assert slow.cycle.model_copy(update={"period_us": 1000.0}) == fast.cycle


def test_the_experiment_is_that_of_section_4() -> None:
    plan = load("paper-4ms")
    assert (plan.bus.speed, plan.bus.gap_count, plan.bus.nodes, plan.bus.max_hops) == ("S400", 63, 2, None)
    assert plan.bus.cable_length_m == 4.5
    assert (plan.cycle.slice_ratio, plan.cycle.sync.ping_us, plan.cycle.sync.ping_per_node_us) == (0.5, 0.3, 0.1)
    payload = plan.payload
    assert (payload.read_bytes, payload.write_bytes, payload.overhead_bytes) == (12, 12, 20)
    assert plan.node.axes == 4


def test_the_bench_is_that_of_table_1() -> None:
    plan = load("paper-two-node")
    assert (plan.bus.speed, plan.bus.gap_count, plan.bus.nodes) == ("S400", 63, 1)


@pytest.mark.parametrize("name", ["paper-two-node", "paper-4ms", "paper-1ms", "paper-optimal-gap"])
def test_execution_times_are_table_1_row_by_row(name: str) -> None:
    execution = load(name).node.execution
    assert list(execution.payload_bytes) == [size for size, _, _ in TABLE_1]
    # The table measured writes. Their response has no payload: its half is that of 4 bytes, 6.0 us, less the 4 bytes
    # that are in it, 32 bits at 393.216 Mbit/s. Decimal, because the paper's figures are, and to its one digit.
    response = Decimal("6.0") - Decimal(32) / Decimal("393.216")
    expected = [
        float((Decimal(latency) - Decimal(half) - response).quantize(Decimal("0.1"))) for _, latency, half in TABLE_1
    ]
    assert list(execution.time_us) == expected == [36.8, 36.7, 45.4, 54.7, 84.9, 141.1, 223.2, 426.7]
    assert execution.grade == "derived"


def test_the_optimal_gap_profile_leaves_the_gap_count_to_the_table() -> None:
    plan = load("paper-optimal-gap")
    assert plan.bus.gap_count == "optimal"
    assert busplan.capacity(plan).results[0].by_key()["gap_count"] == 7


def test_the_what_if_states_its_assumption() -> None:
    plan = load("paper-dma")
    assert plan.node.execution.execution_us(100) == pytest.approx(10 + 0.05 * 100)
    assert "assumption" in plan.description


# --- finding a profile ------------------------------------------------------------------------------------


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_name_means_the_shipped_profile(name: str, work: Path) -> None:
    (work / name).write_text("not this one", encoding="utf-8")
    (work / f"{name}.toml").write_text("nor this one", encoding="utf-8")
    assert load(name).name == name


@pytest.mark.parametrize("argument", ["./paper-4ms", "paper-4ms.toml", "./paper-4ms.toml", "sub/../paper-4ms"])
def test_a_path_means_the_file_even_if_its_name_is_a_shipped_one(argument: str, work: Path) -> None:
    (work / "sub").mkdir()
    (work / argument).write_text(text_of("paper-4ms").replace('"paper-4ms"', '"mine"'), encoding="utf-8")
    assert load(argument).name == "mine"
    assert load(str(work / argument)).name == "mine"


@pytest.mark.parametrize("argument", ["paper-4ms.toml", "paper", "PAPER-4MS", "../paper-4ms", "paper-4ms/"])
@pytest.mark.usefixtures("work")
def test_what_is_neither_is_refused_with_the_shipped_names(argument: str) -> None:
    with pytest.raises(BusplanError) as caught:
        load(argument)
    assert str(caught.value).startswith(f"{argument}: no such file, and no shipped profile of that name; shipped are ")
    assert all(name in str(caught.value) for name in NAMES)


@pytest.mark.usefixtures("work")
def test_an_empty_path_is_refused() -> None:
    with pytest.raises(BusplanError, match=r"\A'': the path is empty; give the name of a file\Z"):
        load("")


@pytest.mark.parametrize("argument", ["a\0b", "x" * 5000], ids=["NUL", "too long"])
def test_a_path_that_no_system_takes_is_refused_in_words(argument: str) -> None:
    with pytest.raises(BusplanError, match=r"cannot be read|no such file"):
        load(argument)


def test_messages_of_a_file_call_it_as_it_was_called(work: Path) -> None:
    (work / "sub").mkdir()
    (work / "sub" / "x.toml").write_text("a", encoding="utf-8")
    with pytest.raises(BusplanError, match=r"\Asub/x\.toml:1:2: "):
        load("sub/x.toml")


# --- a new profile ----------------------------------------------------------------------------------------


NEW_NAMES = ("mine", "[bold]x", 'say "hi"', "back\\slash\\", "größe", "'", "x" * 100, "a # busplan: ignore[b")


@pytest.mark.parametrize("source", ["paper-4ms", "gantry-24", "can-servo-8", "can-fd-arm-7", "sercos3-servo-8"])
def test_a_copy_differs_from_its_source_in_the_name_and_in_what_the_gate_was_told(
    source: str, run: Run, work: Path
) -> None:
    for name in NEW_NAMES[0 if source == "paper-4ms" else -1 :]:
        assert run("init", name, "--from", source, cwd=work).returncode == 0
        text = (work / f"{name}.toml").read_text(encoding="utf-8")
        schema, editor, copied, text_below = text.split("\n", 3)
        assert (f"{schema}\n", "`busplan schema > busplan.schema.json`" in editor) == (SCHEMA_LINE, True)
        assert copied == f"# A copy of the shipped profile {source}: its values stay those until you change them."
        source_text = text_of(source).removeprefix(SCHEMA_LINE)
        changed = [
            line for line in difflib.ndiff(source_text.splitlines(), text_below.splitlines()) if line[:1] in "+-"
        ]
        # A new profile measures a whole turn; the shipped ones have the paper's move.
        turn = [line for line in changed if line.startswith('+ path = "iso230-4" ')]
        changed = [line for line in changed if line not in turn]
        asks = "\n[circle]" in source_text and "\npath = " not in source_text
        assert len(turn) == asks
        told = [line for line in changed[2:] if line[:1] == "-"]
        assert all("# busplan: ignore[" in line for line in told)
        assert [line[2:].rstrip() for line in changed[2:] if line[:1] == "+"] == [
            line[2:].partition("# busplan:")[0].rstrip() for line in told if not line[2:].startswith("#")
        ]
        assert changed[0] == f'- name = "{source}"'
        assert tomllib.loads(changed[1][2:]) == {"name": name}
        expected = {"name": name, **({"circle.path": "iso230-4"} if asks else {})}
        assert load(str(work / f"{name}.toml")) == busplan.load_profile(source, changes=expected)


@pytest.mark.parametrize("name", ["x" * 101, "a\nb", "\x1b[31m", 'x"\nevil = 1 #'], ids=ascii)
def test_a_copy_has_no_name_that_a_profile_cannot_have(name: str, run: Run, work: Path) -> None:
    done = run("init", name, "--from", "paper-4ms", cwd=work)
    assert (done.returncode, list(work.iterdir())) == (2, [])
    assert done.stderr == f"{name!r}: no name for a profile; expected 1 to 100 printable characters\n"


@pytest.mark.parametrize("source", ["nope", "", "paper-4ms.toml", "../profiles/paper-4ms", "-"])
def test_a_copy_is_of_a_shipped_profile_alone(source: str, run: Run, work: Path) -> None:
    done = run("init", "x", "--from", source, cwd=work)
    assert (done.returncode, list(work.iterdir())) == (2, [])
    assert done.stderr.startswith(
        f"--from {source}: no shipped profile; shipped are can-fd-arm-7, can-fd-motors-8, can-motors-8, "
    )


def test_a_file_called_like_standard_input_is_a_file(work: Path) -> None:
    (work / "-").write_text(text_of("paper-1ms"), encoding="utf-8")
    assert load("./-").name == "paper-1ms"


def test_the_shipped_can_networks_are_those_that_they_say() -> None:
    arm: Any = load("can-fd-arm-7")
    machine: Any = load("canopen-6")
    assert (arm.bus.nodes, arm.bus.bit_rate_kbit_s, arm.bus.data_bit_rate_kbit_s) == (7, 1000, 5000)
    (nodes,) = arm.node_groups
    assert (nodes.bytes_of("read"), nodes.bytes_of("write")) == (16, 4)
    assert all(message.fd for message in arm.message)
    # Frames of 4 and 16 bytes: 32 nominal bits, and 75 and 195 data bits.
    (found,) = busplan.capacity(arm, timing_model=["worst-stuffing"]).results
    us = {term.name: term.us for term in found.terms}
    assert (us["command"], us["feedback"]) == (7 * (32 + 75 / 5), 7 * (32 + 195 / 5))
    assert (machine.bus.nodes, machine.bus.data_bit_rate_kbit_s) == (6, None)
    assert [message.per_node for message in machine.message] == [True] * 3
    for profile in (arm, machine):
        assert busplan.capacity(profile).results[0].verdict == "fits"
