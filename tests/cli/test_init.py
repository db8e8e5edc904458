"""`busplan init`: a new profile, as a whole or not at all, and never over an old one unasked."""

import errno
import json
import os
import pty
import re
import select
import subprocess
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

Run = Callable[..., Any]
Refused = Callable[..., str]


def files(folder: Path) -> dict[str, bytes]:
    """All files of a folder, hidden ones too, with what they hold."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def name_in(path: Path) -> object:
    return tomllib.loads(path.read_text(encoding="utf-8"))["name"]


# --- as a process -----------------------------------------------------------------------------------------


GANTRY = ("--bus", "ieee1394", "--nodes", "6", "--axes", "24", "--period", "1ms", "--bytes-per-axis", "8")


def test_init_writes_a_profile_of_ones_own_machine_with_its_verdict(run: Run, tmp_path: Path) -> None:
    done = run("init", "gantry", *GANTRY, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    wrote, verdict, *_, following = done.stderr.splitlines()
    assert wrote == "wrote gantry.toml"
    assert following == "next: busplan capacity gantry.toml"
    assert list(files(tmp_path)) == ["gantry.toml"]
    own = run("capacity", "gantry.toml", cwd=tmp_path)
    assert own.stdout.splitlines()[0].startswith(verdict)
    data = tomllib.loads((tmp_path / "gantry.toml").read_text(encoding="utf-8"))
    assert (data["bus"]["nodes"], data["node"]["axes"], data["cycle"]["period_us"]) == (6, 4, 1000)
    assert (data["payload"]["read_bytes_per_axis"], data["payload"]["write_bytes_per_axis"]) == (8, 8)
    first, second, *_ = (tmp_path / "gantry.toml").read_text(encoding="utf-8").splitlines()
    assert first == "#:schema ./busplan.schema.json"
    (command,) = re.findall("`busplan (schema) > busplan.schema.json`", second)
    jsonschema.validate(data, json.loads(run(command).stdout))
    assert (data["limits"]["reserve"], data["circle"]["path"]) == (0.15, "iso230-4")
    # Nobody invented how round its circle must be.
    assert "tolerance" not in data
    assert (data["node"]["execution"]["grade"], data["servo"]["grade"]) == ("assumed", "assumed")


@pytest.mark.parametrize("bus", ["can", "ieee1394"])
def test_the_sections_that_init_only_suggests_are_of_use_as_they_stand(run: Run, tmp_path: Path, bus: str) -> None:
    run("init", "press", "--bus", bus, "--nodes", 6, "--axes", 6, "--period", "4ms", cwd=tmp_path)
    path = tmp_path / "press.toml"
    path.write_text(re.sub(r"(?m)^# (?=\[|\w+ = )", "", path.read_text(encoding="utf-8")), encoding="utf-8", newline="")
    messages = [message["name"] for message in tomllib.loads(path.read_text(encoding="utf-8")).get("message", [])]
    assert messages == (["sdo-response", "heartbeat"] if bus == "can" else [])
    done = run("check", "press.toml", "--no-circle", cwd=tmp_path)
    assert (done.returncode, "0 errors" in done.stderr) == (0, True), done.stdout


def test_a_profile_of_ones_own_is_neutral_and_no_command_stumbles_over_it(run: Run, tmp_path: Path) -> None:
    run("init", "gantry", *GANTRY, "--period", "2.4ms", cwd=tmp_path)  # assumed times may be twice as long
    text = (tmp_path / "gantry.toml").read_text(encoding="utf-8")
    assert "paper" not in text.lower()
    assert "section" not in text
    # Every number says that it is assumed, as a table's grade does, or is one that was asked for.
    for line in text.splitlines():
        if re.match(r"[a-z_]+ = ", line) and not re.match(
            "(schema_version|name|description|nodes|period_us|axes)", line
        ):
            assert re.search("#|per_axis|grade|kind|time_us|reserve|radius|feed", line), line
    checked = run("check", "gantry.toml", cwd=tmp_path)
    assert (checked.returncode, sorted(set(re.findall("BP[0-9]+", checked.stdout)))) == (0, ["BP112", "BP113"])
    circle = run("circle-test", "gantry.toml", cwd=tmp_path)
    assert circle.returncode == 0
    assert "no error source of this profile matters; circular deviation G below 0.1 um" in circle.stdout
    assert "The servo values that the profile gives are assumed." in circle.stdout


def test_init_takes_defaults_where_nobody_can_be_asked_and_says_them(run: Run, tmp_path: Path) -> None:
    done = run("init", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    taken = "not given, so taken: --bus ieee1394 --nodes 4 --axes 16 --period 1ms --bytes-per-axis 8"
    assert done.stderr.splitlines()[:2] == [taken, "wrote my-machine.toml"]
    some = run("init", "other", "--nodes", "2", "--period", "850us", cwd=tmp_path)
    assert some.stderr.startswith("not given, so taken: --bus ieee1394 --axes 8 --bytes-per-axis 8\n")
    # The step of the simulation divides any period.
    assert run("circle-test", "other.toml", cwd=tmp_path).returncode == 0


def test_init_writes_unlike_nodes_as_groups_and_knows_a_bus_by_its_other_names(run: Run, tmp_path: Path) -> None:
    groups = ("--group", "dual:4x2", "--group", "io:3x0:32/8", "--group", "tool:1x1:40/24")
    done = run("init", "packer", "--bus", "EtherCAT", *groups, "--period", "1ms", "--host", "stock", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr.startswith("not given, so taken: --bytes-per-axis 8\n")
    data = tomllib.loads((tmp_path / "packer.toml").read_text(encoding="utf-8"))
    assert (data["bus"]["kind"], "nodes" in data["bus"]) == ("ethercat", False)
    dual, io, tool = ({**group, "execution": None} for group in data["group"])
    assert (dual["name"], dual["nodes"], dual["axes"], dual["write_bytes_per_axis"]) == ("dual", 4, 2, 8)
    assert (io["name"], io["nodes"], io["axes"], io["read_bytes"], io["write_bytes"]) == ("io", 3, 0, 32, 8)
    # Bytes of a group are those of a node.
    assert (tool["read_bytes"], tool["write_bytes"], "read_bytes_per_axis" in tool) == (40, 24, False)
    # It speaks of the machine, and not of figures that the next edit changes.
    assert data["description"] == "A new machine; assumed values are marked: measure and replace them"


CLOSED = {"FORK_FIRST": "import os, sys; os.close(0); sys.stdin = sys.__stdin__ = None"}


def test_init_asks_nothing_where_nobody_can_answer(run: Run, tmp_path: Path) -> None:
    for name, env in (("open", None), ("closed", CLOSED)):
        done = run("init", name, cwd=tmp_path, env=env)
        assert (done.returncode, done.stdout) == (0, "")
        assert done.stderr.startswith("not given, so taken: --bus ieee1394 ")
    written = [(tmp_path / f"{name}.toml").read_text(encoding="utf-8") for name in ("open", "closed")]
    assert written[0].replace("open", "closed") == written[1]


def state_of(pid: int) -> str:
    """State of a process: R where it runs, S where it waits."""
    return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]


def answered(program: Path, folder: Path, *answers: bytes, arguments: tuple[str, ...] = ()) -> tuple[int, str]:
    """Exit code and words of `init` in a terminal, with an answer to each of its questions."""
    leader, follower = pty.openpty()
    # The terminal of a session of its own, so that Ctrl-C reaches the program, also where the tests ignore it.
    env = {**os.environ, "FORK_FIRST": "import os; os.login_tty(0); os.write(1, b'%d ' % os.getpid())"}
    command = [str(program), "init", "asked", *arguments]
    process = subprocess.Popen(command, cwd=folder, stdin=follower, stdout=follower, stderr=follower, env=env)
    os.close(follower)
    said = ""

    def heard() -> bool:
        nonlocal said
        try:
            said += os.read(leader, 10_000).decode()
        except OSError:  # the program has left its terminal
            return False
        return True

    for answer in answers:
        # A question ends in its default.
        while not said.rstrip().endswith("]:"):
            assert select.select([leader], [], [], 300)[0]
            assert heard()
        # A signal between a prompt and its read is lost, as at any keyboard: the program must wait for the answer.
        end = time.monotonic() + 300
        while state_of(int(said.split(maxsplit=1)[0])) != "S":
            assert time.monotonic() < end
            time.sleep(0.02)
        said += "<"
        os.write(leader, answer)
    code = process.wait(timeout=300)
    while select.select([leader], [], [], 0.1)[0] and heard():
        pass
    os.close(leader)
    return code, said


def test_init_asks_in_a_terminal_for_what_is_missing(program: Path, tmp_path: Path) -> None:
    # What is no number is asked for again.
    code, said = answered(
        program,
        tmp_path,
        b"myrinet\n",
        b"FireWire\n",
        b"many\n",
        b"0\n",
        b"5\n",
        b"\n",
        b"12\n",
        b"stock\n",
        arguments=("--axes", "10"),
    )
    assert code == 0
    assert said.index("myrinet: no kind of bus") < said.index("Nodes, the host")
    assert said.count("Nodes, the host not counted [3]") == 3
    assert "must be 1 or more" in said
    assert "Axes of all nodes" not in said
    assert "real-time: PREEMPT_RT with a stock driver" in said
    assert "Host: real-time, low-latency, stock, none [none]:" in said
    data = tomllib.loads((tmp_path / "asked.toml").read_text(encoding="utf-8"))
    assert (data["bus"]["nodes"], data["node"]["axes"], data["payload"]["read_bytes_per_axis"]) == (5, 2, 12)
    assert (data["bus"]["sync_jitter_us"], data["bus"]["sync_jitter_cycles"]) == (235_000, 900_000)


def test_ctrl_c_at_a_question_is_an_interrupt_and_an_input_that_ends_is_no_answer(
    program: Path, tmp_path: Path
) -> None:
    assert answered(program, tmp_path, b"can\n", b"6\n", b"\x03")[0] == 130
    code, said = answered(program, tmp_path, b"\x04")
    assert code == 2
    assert "no answer: give --bus, --nodes, --axes, --period, --bytes-per-axis and --host" in said
    assert files(tmp_path) == {}


def test_init_starts_from_the_shipped_profile_that_is_asked_for(run: Run, tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    done = run("init", "sub/press.toml", "--from", "paper-dma", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert name_in(tmp_path / "sub" / "press.toml") == "press"
    text = (tmp_path / "sub" / "press.toml").read_text(encoding="utf-8")
    assert "\n# A copy of the shipped profile paper-dma: its values stay those until you change them.\n" in text
    assert "assumption" in text


def test_init_overwrites_with_force_only(run: Run, refused: Refused, tmp_path: Path) -> None:
    target = tmp_path / "mine.toml"
    target.write_bytes(b"old")
    for name in ("mine", "mine.toml", "./mine"):
        assert refused("init", name, cwd=tmp_path).endswith(
            "mine.toml: already there; give another name, or --force to overwrite it"
        )
    assert files(tmp_path) == {"mine.toml": b"old"}
    assert run("init", "mine", "--force", cwd=tmp_path).returncode == 0
    assert list(files(tmp_path)) == ["mine.toml"]
    assert name_in(target) == "mine"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("init", "x", "--from", "nope"),
            "--from nope: no shipped profile; shipped are can-fd-arm-7, can-fd-motors-8, can-motors-8, ",
        ),
        (("init", "x", "--period", "0us"), "--period 0us: must be between 0.001 and 1e+09 us"),
        (
            ("init", "x", "--from", "paper-1ms", "--axes", "8"),
            "--from: cannot be used with --axes: a copy has the values",
        ),
        (("init", "x", "--bus", "myrinet"), "--bus myrinet: no kind of bus; there are ieee1394, "),
        (("init", "x", "--group", "io:3"), "--group io:3: expected NAME:NODESxAXES or "),
        (("init", "x", "--group", "io:0x1"), "--group io:0x1: must have 1 node or more"),
        (("init", "x", "--group", "a:1x1", "--group", "a:2x1"), "--group a:2x1: there is a group a already"),
        (
            ("init", "x", "--group", "a:1x1", "--axes", "2"),
            "--group: cannot be used with --nodes or --axes: each group",
        ),
        (("init", "x", "--group", "a:1x1:4/4", "--bytes-per-axis", "2"), "--bytes-per-axis: nothing takes it"),
        (("init", "x", "--group", "a:1x0:0/0"), "group.a.write_bytes = 0: makes 0 bytes"),
        (
            ("init", "x", "--bus", "can", *(word for number in range(128) for word in ("--group", f"g{number}:1x1"))),
            "group: has 128 entries, must have 127 or fewer",
        ),
        (("init", "x", "--bus", "ethercat", "--nodes", "1000001"), "bus.nodes = 1000001: must be 1,000,000 or less"),
        (
            ("init", "x", "--bus", "can", "--host", "stock", "--period", "2us"),
            "--host stock: bus.sync_jitter_us = 235000: is not under cycle.period_us, 2: ",
        ),
        (("init", "x", "--from", "dvrk", "--group", "a:1x1"), "--from: cannot be used with --group"),
        (("init", "a\nb"), r"'a\nb': no name for a profile; expected 1 to 100 printable characters"),
        (("init", "\x1b[31m"), r"'\x1b[31m': no name for a profile"),
        (("init", "missing/x"), "missing/x.toml: cannot be written: there is no folder /"),
        (("init", "folder.toml"), "folder.toml: already there"),
        (("init", "folder.toml", "--force"), "folder.toml: cannot be written: Is a directory"),
    ],
    ids=lambda value: repr(" ".join(value))[:30] if isinstance(value, tuple) else None,
)
def test_init_refuses_what_it_cannot_write(
    refused: Refused, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    (tmp_path / "file").write_bytes(b"kept")
    (tmp_path / "folder.toml").mkdir()
    message = refused(*arguments, cwd=tmp_path)
    assert message.startswith(said)
    assert "\n" not in message
    assert files(tmp_path) == {"file": b"kept"}
    assert list((tmp_path / "folder.toml").iterdir()) == []


@pytest.mark.parametrize("name", ["", "..", ".toml", "sub/", "sub/.toml", "/"])
def test_init_refuses_a_path_without_a_name(refused: Refused, tmp_path: Path, name: str) -> None:
    (tmp_path / "sub").mkdir()
    said = f"{name!r}: no name for a profile; expected a name or a path, as press-line"
    assert refused("init", name, cwd=tmp_path) == said
    assert list(tmp_path.rglob("*")) == [tmp_path / "sub"]


# --- writing a file ---------------------------------------------------------------------------------------


def failing(number: int) -> Callable[..., None]:
    """A call of the operating system that fails."""

    def call(*_: object, **_options: object) -> None:
        raise OSError(number, os.strerror(number))

    return call


@pytest.mark.parametrize("name", ["new", "old"])
def test_a_disk_that_fills_up_leaves_what_was_there(
    refused: Refused, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "old.toml").write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", failing(errno.ENOSPC))
    said = refused("init", name, "--force", cwd=tmp_path)
    assert said == f"{name}.toml: cannot be written: No space left on device"
    assert files(tmp_path) == {"old.toml": b"old"}


def test_a_name_taken_a_moment_ago_is_not_overwritten(
    refused: Refused, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _descriptor: (tmp_path / "x.toml").write_bytes(b"theirs"))
    assert "x.toml: already there" in refused("init", "x", cwd=tmp_path)
    assert files(tmp_path) == {"x.toml": b"theirs"}


def test_a_file_system_without_hard_links_is_written_to_and_still_not_over(
    run: Run, refused: Refused, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "link", failing(errno.EPERM))
    assert run("init", "x", cwd=tmp_path).returncode == 0
    before = files(tmp_path)
    assert "already there" in refused("init", "x", "--nodes", "9", cwd=tmp_path)
    assert files(tmp_path) == before


@pytest.mark.parametrize("nameless", [True, False])
def test_a_new_file_has_the_permissions_of_any_other(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, nameless: bool
) -> None:
    if not nameless:  # another system, or a network's file system
        monkeypatch.delattr(os, "O_TMPFILE", raising=False)
    (tmp_path / "other").touch()
    assert run("init", "x", cwd=tmp_path).returncode == 0
    assert (tmp_path / "x.toml").stat().st_mode == (tmp_path / "other").stat().st_mode
    assert set(files(tmp_path)) == {"other", "x.toml"}


@pytest.mark.parametrize("name", ["pipe.toml", "link.toml"])
def test_what_is_no_regular_file_is_not_replaced(refused: Refused, tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "link.toml").symlink_to("pipe.toml")
    assert refused("init", name, "--force", cwd=tmp_path) == f"{name}: cannot be written: is not a regular file"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.toml", "pipe.toml"]
    assert (tmp_path / "pipe.toml").is_fifo()


def test_servos_of_a_robot_have_one_axis_their_own_data_and_no_circle(run: Run, tmp_path: Path) -> None:
    for given in (("--nodes", 6), ("--axes", 6)):
        run("init", "arm", "--force", "--bus", "dynamixel", *given, cwd=tmp_path)
        data = tomllib.loads((tmp_path / "arm.toml").read_text(encoding="utf-8"))
        assert (data["bus"]["nodes"], data["node"]["axes"]) == (6, 1)
        # Current, velocity and position of an X servo, and its goal position.
        assert (data["payload"]["read_bytes"], data["payload"]["write_bytes"]) == (10, 4)
        assert not data.keys() & {"circle", "servo", "tolerance", "mechanics"}
        # A new servo waits 500 us.
        assert "return_delay_us" not in data["bus"]


def test_motors_of_a_robot_have_one_axis_and_a_frame_each_way(run: Run, tmp_path: Path) -> None:
    run("init", "arm", "--bus", "can-motors", "--axes", 6, cwd=tmp_path)
    data = tomllib.loads((tmp_path / "arm.toml").read_text(encoding="utf-8"))
    assert (data["bus"]["nodes"], data["node"]["axes"]) == (6, 1)
    assert (data["payload"]["read_bytes"], data["payload"]["write_bytes"]) == (8, 8)
    assert not data.keys() & {"circle", "servo", "tolerance", "mechanics"}


def test_axes_alone_get_the_nodes_that_they_need(run: Run, tmp_path: Path) -> None:
    run("init", "press", "--axes", 6, cwd=tmp_path)
    data = tomllib.loads((tmp_path / "press.toml").read_text(encoding="utf-8"))
    assert (data["bus"]["nodes"], data["node"]["axes"]) == (2, 3)


def test_axes_that_do_not_divide_evenly_make_two_groups_each_with_its_own_hints(run: Run, tmp_path: Path) -> None:
    run("init", "odd", "--nodes", 3, "--axes", 7, "--period", "850us", "--bytes-per-axis", 5, cwd=tmp_path)
    text = (tmp_path / "odd.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    sizes = {"read_bytes_per_axis": 5, "write_bytes_per_axis": 5}
    assert [{key: group[key] for key in group if key != "execution"} for group in data["group"]] == [
        {"name": "axes-3", "nodes": 1, "axes": 3, **sizes},
        {"name": "axes-2", "nodes": 2, "axes": 2, **sizes},
    ]
    assert re.findall(r"busplan calibrate odd.toml MEASUREMENTS.csv( --group \S+)? --apply", text) == [
        " --group axes-3",
        " --group axes-2",
    ]
    assert "nodes" not in data["bus"]
    # The longest step up to 100 us that divides 850.
    assert (data["servo"]["step_us"], data["cycle"]) == (85, {"period_us": 850, "slice_ratio": 0.8})
    # Comments stand below each other.
    columns = {line.index("#") for line in text.splitlines() if re.match(r"(?!payload)[a-z].{0,25} #", line)}
    assert columns == {27}


def test_a_rate_that_is_given_is_not_assumed(run: Run, tmp_path: Path) -> None:
    given = ("--bus", "can", "--nodes", 3, "--axes", 6, "--period", "4ms", "--bit-rate", 250)
    run("init", "slow", *given, cwd=tmp_path)
    text = (tmp_path / "slow.toml").read_text(encoding="utf-8")
    assert re.findall("(?m)^bit_rate.*", text) == ["bit_rate_kbit_s = 250"]
    assert "\nnodes = 3                  # the host is not counted\n" in text
