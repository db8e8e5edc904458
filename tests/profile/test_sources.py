"""Where profiles come from: paths of a collection, data of no file, and machines of another kind of bus."""

import io
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan import BusplanError
from busplan.profile.conversion import AssumedKey, converted
from busplan.profile.document import decode, profile_of, read_bytes
from busplan.profile.edit import profile_text
from busplan.profile.kinds import kinds_with
from busplan.profile.sources import Collection, collect, locate_measurements

LINE = """\
schema_version = 1
name = "line"
bus = {kind = "ieee1394", speed = "S400", nodes = 2}
cycle = {period_us = 4000}
payload = {read_bytes = 12, write_bytes = 12}
node = {axes = 4, execution = {kind = "linear", base_us = 30, per_byte_us = 0.35}}
"""


@pytest.fixture(autouse=True)
def _work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def named(found: Collection) -> list[tuple[str, str | None]]:
    return [(source.name, source.failure) for source in found.sources]


def test_a_list_of_paths_means_each_profile_once_and_says_what_is_none() -> None:
    for path in ("a/b/one.toml", "a/two.toml", "a/.hidden/no.toml", "a/node_modules/no.toml"):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(LINE)
    Path("a/other.toml").write_text("x = 1\n# schema_version\n")
    Path("a/text.txt").write_text(LINE)
    for path in ("busplan.toml", "a/busplan.toml"):
        Path(path).write_text("[check]\n")
    Path("empty").mkdir()
    Path("paper-4ms.toml").write_text(LINE)
    found = collect(["a/two.toml", "-", "a", "./a/b/../two.toml", "paper-4ms", "paper-4ms.toml"], stdin_name="x.toml")
    shipped, own = "paper-4ms.toml", str(Path("paper-4ms.toml").absolute())
    assert named(found) == [(name, None) for name in ("a/two.toml", "x.toml", "a/b/one.toml", shipped, own)]
    assert [source.is_shipped for source in found.sources] == [False, False, False, True, False]
    assert found.skipped == ("a/other.toml",)
    # What is named is read, whatever it has; where others are skipped, a file without the mark of a profile is none.
    assert named(collect(["a/other.toml", "a/text.txt"])) == [("a/other.toml", None), ("a/text.txt", None)]
    others = collect(["a/other.toml", "a/text.txt", "busplan.toml", "a/other.toml"], skip_others=True)
    assert (named(others), others.skipped) == ([("a/text.txt", None)], ("a/other.toml", "busplan.toml"))
    refused = collect(["busplan.toml", "empty", "a/busplan.toml/x", "nowhere.toml", "nowhere.toml", "a\0b", "/a\0b"])
    assert [(name, failure and failure.partition(" shipped ")[0]) for name, failure in named(refused)] == [
        ("busplan.toml", "busplan.toml: has settings of `busplan check`, but no profile"),
        ("empty", "empty: no profile below this folder (a *.toml with a schema_version)"),
        ("a/busplan.toml/x", "a/busplan.toml/x: no such file, and no"),
        ("nowhere.toml", "nowhere.toml: no such file, and no"),
        ("a\0b", "a\0b: no such file, and no"),
        ("/a\0b", "/a\0b: no such file, and no"),
    ]


def test_a_folder_below_that_cannot_be_read_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def walk(folder: Path, *, onerror: Any) -> Any:
        onerror(PermissionError(13, "Permission denied", f"{folder}/closed"))
        return iter([])

    Path("open").mkdir()
    monkeypatch.setattr("os.walk", walk)
    assert named(collect(["open"])) == [("open/closed", "open/closed: cannot be read: Permission denied")]


def test_what_is_read_is_bounded_and_what_cannot_be_read_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("five").write_bytes(b"12345")
    assert [read_bytes(Path("five"), name="x", limit=limit) for limit in (3, 5)] == [b"1234", b"12345"]
    Path("dangling").symlink_to("nowhere")
    for name, words in (("dangling", "no such file"), (".", "is a directory; give a file"), ("a\0b", "cannot be read")):
        with pytest.raises(BusplanError, match=words):
            read_bytes(Path(name), name="x")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"12345")))
    assert read_bytes(Path("-"), name="x", limit=3) == b"1234"
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(BusplanError, match=r"^x: standard input is closed$"):
        read_bytes(Path("-"), name="x")


def test_an_array_is_a_key_of_the_kinds_that_have_it_and_so_is_a_place_in_it() -> None:
    assert kinds_with(("message",)) == kinds_with(("message", 0)) == kinds_with(("message", 0, "period_us")) == ["can"]
    assert kinds_with(("message", 0, "gap_count")) == []


def test_measurements_are_a_file_before_they_are_the_shipped_example() -> None:
    shipped = locate_measurements("table-1.csv")
    assert (shipped.name, shipped.shipped, shipped.path.is_file()) == ("table-1.csv", True, True)
    Path("table-1.csv").write_text("")
    assert locate_measurements("table-1.csv") == (Path("table-1.csv"), "table-1.csv", False)
    assert locate_measurements("-") == (Path("-"), "<stdin>", False)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le", "cp1252"])
def test_a_machine_s_file_is_named_whatever_its_characters(encoding: str) -> None:
    text = 'VERSION ""\nBO_ 291 Drehzahl: 8 X\n SG_ Umgebung_ü : 0|8@1+ (1,0) [0|0] "°C" X\n'
    content = ("\ufeff" * encoding.startswith("utf-16") + text).encode(encoding)
    with pytest.raises(BusplanError, match=r"^x:1:1: is DBC, not a profile; convert it with `busplan import x`$"):
        decode(content, name="x").data()
    eni = '<?xml version="1.0"?>\n<!-- a comment -->\n<x:EtherCATConfig>\u00fc</x:EtherCATConfig>'
    with pytest.raises(BusplanError, match=r"^x:1:1: is ENI, not a profile; convert it with `busplan import x`$"):
        decode(("\ufeff" * encoding.startswith("utf-16") + eni).encode(encoding), name="x").data()
    with pytest.raises(BusplanError, match=r"^x:1:1: is a CAN log, not a profile; convert it with `busplan import x`$"):
        decode(b"(1.000000) can0 181#00\n", name="x").data()
    # Zeros are of no text.
    with pytest.raises(BusplanError, match=r"not a text file|not valid TOML"):
        decode(b"\xff\0" + text.encode("cp1252"), name="x").data()


def test_data_of_no_file_are_a_profile_or_refused_by_their_keys() -> None:
    Path("line.toml").write_text(LINE)
    data = tomllib.loads(LINE)
    assert profile_of(data) == busplan.load_profile("line.toml")
    # Without a file it has no comments, and is written with what it sets alone.
    assert tomllib.loads(profile_text(profile_of(data))) == data
    data["bus"] |= {"nodes": 0, "x": 1}
    with pytest.raises(BusplanError) as caught:
        profile_of(data)
    assert sorted(problem.partition(";")[0] for problem in caught.value.problems) == [
        "bus.nodes: must be 1 or more",
        "bus.x: unknown key",
    ]


# --- another kind of bus ----------------------------------------------------------------------------------

GROUPS = """\
schema_version = 1
name = "groups"
bus = {kind = "ethercat", master = "SOEM", distributed_clocks = true}
cycle = {period_us = 1000, slice_ratio = 0.8}
[[group]]
name = "coupler"
nodes = 1
axes = 0
read_bytes = 0
write_bytes = 0
[[group]]
name = "drives"
nodes = 3
axes = 1
read_bytes_per_axis = 6
write_bytes_per_axis = 8
execution = {kind = "linear", base_us = 10, per_byte_us = 0.1, grade = "measured"}
[[group]]
name = "io"
nodes = 2
axes = 0
read_bytes = 4
write_bytes = 0
"""


def test_couplers_and_keys_of_one_kind_alone_stay_behind() -> None:
    Path("groups.toml").write_text(GROUPS)
    own: Any = busplan.load_profile("groups.toml")
    found = converted(own, "can")
    assert [(group.name, group.nodes, group.axes) for group in found.profile.group] == [("drives", 3, 1), ("io", 2, 0)]
    assert found.left_out == ("bus.master", "bus.distributed_clocks", "group.coupler")
    sizes = [(int(group.bytes_of("read")), int(group.bytes_of("write"))) for group in found.profile.node_groups]
    assert sizes == [(6, 8), (4, 0)]
    drives: Any = found.profile.group[0].execution
    # It was measured on the other bus.
    assert (drives.base_us, drives.per_byte_us, drives.grade) == (10, 0.1, "assumed")
    assert (found.profile.cycle.period_us, found.profile.cycle.slice_ratio) == (1000, 0.8)
    assert found.profile.bus.kind == "can"
    assert AssumedKey("bus.bit_rate_kbit_s", 1000, "new profile") in found.assumed
    same = converted(own, "ethercat")
    assert (same.profile is own, same.assumed, same.left_out) == (True, (), ())


def test_a_machine_of_couplers_alone_stays_as_it_is() -> None:
    head, coupler, *_ = GROUPS.split("[[group]]")
    Path("groups.toml").write_text(f"{head}[[group]]{coupler}")
    with pytest.raises(BusplanError, match="nodes without data have no part in the cycle"):
        converted(busplan.load_profile("groups.toml"), "can")


CAN_GROUPS = """\
schema_version = 1
name = "groups"
bus = {kind = "can", bit_rate_kbit_s = 1000}
cycle = {period_us = 10000}
[[group]]
name = "drives"
nodes = 3
axes = 2
pdo_per = "axis"
feedback_pdos = [6, 2]
command_pdos = [7]
every = 2
execution = {kind = "linear", base_us = 10, per_byte_us = 0.1}
[[group]]
name = "io"
nodes = 2
axes = 0
feedback_pdos = [4]
command_pdos = []
every = 4
execution = {kind = "linear", base_us = 10, per_byte_us = 0.1}
"""


def test_pdos_are_bytes_on_another_bus_and_rates_stay_where_it_has_rates() -> None:
    Path("groups.toml").write_text(CAN_GROUPS)
    own: Any = busplan.load_profile("groups.toml")
    own_keys = [f"group.{name}.{key}" for name in ("drives", "io") for key in ("feedback_pdos", "command_pdos")]
    for kind, rates, left_out in (
        ("ethercat", [2, 4], {"bus.bit_rate_kbit_s", "group.drives.pdo_per", *own_keys}),
        (
            "ieee1394",
            [None, None],
            {"bus.bit_rate_kbit_s", "group.drives.pdo_per", *own_keys, "group.drives.every", "group.io.every"},
        ),
    ):
        found = converted(own, kind)
        sizes = [[int(group.bytes_of(way)) for way in ("read", "write")] for group in found.profile.node_groups]
        assert sizes == [[16, 14], [4, 0]]
        drives: Any = found.profile.group[0]
        # What each axis adds stays what each axis adds.
        assert (drives.read_bytes_per_axis, drives.write_bytes_per_axis) == (8, 7)
        assert [getattr(group, "every", None) for group in found.profile.group] == rates
        assert {*found.left_out} == left_out
