"""Bad input: one clear message with its place, exit 2, nothing on stdout, no traceback."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

Run = Callable[..., Any]
Refused = Callable[..., str]

TEXT = """\
schema_version = 1
name = "mine"
[bus]
kind = "ieee1394"
speed = "S400"
nodes = 2
[cycle]
period_us = 4000
[payload]
read_bytes = 12
write_bytes = 12
[node]
axes = 4
[node.execution]
kind = "table"
payload_bytes = [4, 16, 32]
time_us = [36.7, 36.3, 44.7]
"""


def edited(old: str, new: str) -> bytes:
    assert TEXT.count(old) == 1
    return TEXT.replace(old, new).encode()


BAD_FILES: dict[str, tuple[bytes, str]] = {
    "bytes": (b"\x7fELF\x02\x01\x01\x00\x00\xff\xfe\x80", "bad.toml:1:10: not a text file: byte 0xff is not UTF-8"),
    "syntax error": (edited("nodes = 2", "nodes = "), "bad.toml:6:9: not valid TOML: invalid value"),
    "wrong type": (edited("nodes = 2", 'nodes = "2"'), 'bad.toml:6:1: bus.nodes = "2": expected a whole number'),
    "nan": (edited("4000", "nan"), "bad.toml:8:1: cycle.period_us = nan: must be finite"),
    "negative": (edited("4000", "-1"), "bad.toml:8:1: cycle.period_us = -1: must be 0.001 or more"),
    "unknown key": (
        edited("axes = 4", "axes = 4\naxis = 4"),
        "bad.toml:14:1: node.axis: unknown key; did you mean axes?",
    ),
    "unknown speed": (
        edited('"S400"', '"S4000"'),
        'bad.toml:5:1: bus.speed = "S4000": expected "S100", "S200", "S400", "S800", "S1600" or "S3200"',
    ),
    "table lengths": (
        edited(", 44.7", ""),
        "bad.toml:17:1: node.execution.time_us = [36.7, 36.3]: has 2 values and payload_bytes has 3",
    ),
    "not ascending": (
        edited("[4, 16, 32]", "[16, 4, 32]"),
        "bad.toml:16:22: node.execution.payload_bytes[1] = 4: payloads must ascend, and this follows 16",
    ),
    "payload outside the table": (
        edited("read_bytes = 12", "read_bytes = 64"),
        "bad.toml:10:1: payload.read_bytes = 64: is outside the execution table, 4 to 32 bytes",
    ),
    "10 MB of nested brackets": (b"[" * 10_000_000, "bad.toml:1:1: the file is over 2,000,000 bytes"),
    "nested brackets in a file of the right size": (
        b"x = " + b"[" * 45_000 + b"]" * 45_000,
        "bad.toml:1:105: nested too deeply",
    ),
    "a number of many digits": (
        edited("4000", "4" * 9000),
        "bad.toml:8:13: not valid TOML: a number with too many digits",
    ),
}


@pytest.mark.parametrize(("content", "said"), BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_gets_one_message_with_its_place(
    refused: Refused, tmp_path: Path, content: bytes, said: str
) -> None:
    (tmp_path / "bad.toml").write_bytes(content)
    message = refused("capacity", "bad.toml", cwd=tmp_path)
    assert message.startswith(said)
    assert "\n" not in message


def test_what_is_no_file_is_refused(refused: Refused, tmp_path: Path) -> None:
    said = refused("capacity", "missing.toml", cwd=tmp_path)
    assert said.startswith("missing.toml: no such file, and no shipped profile")
    assert refused("capacity", ".", cwd=tmp_path) == ".: is a directory; give a file"
    said = refused("explain", "paper-4ms", "x" * 10_000)
    assert len(said) < 1100
    assert said.endswith("x: no such figure; without one, explain --all lists them")


def test_an_empty_file_is_told_what_a_profile_needs(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "empty.toml").touch()
    said = refused("capacity", "empty.toml", cwd=tmp_path).splitlines()
    assert [line.split(": ")[:2] for line in said] == [
        ["empty.toml:1:1", key] for key in ("schema_version", "name", "bus", "cycle", "payload", "node")
    ]


def test_all_faults_of_a_file_are_told_at_once_in_their_order(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_bytes(
        edited("nodes = 2", "nodes = 0").replace(b"4000", b"nan").replace(b"axes", b"axs")
    )
    said = refused("latency", "bad.toml", cwd=tmp_path).splitlines()
    assert [line.partition(": ")[0] for line in said] == [f"bad.toml:{at}" for at in ("6:1", "8:1", "12:2", "13:1")]


def test_standard_input_is_called_so_in_messages(refused: Refused) -> None:
    assert refused("capacity", "-", stdin="x") == (
        "<stdin>:1:2: not valid TOML: expected '=' after a key in a key/value pair, and the file ends"
    )
    assert refused("capacity", "-", stdin=b"\xff").startswith("<stdin>:1:1: not a text file")
    assert refused("latency", "-", stdin=b"[" * 3_000_000).startswith("<stdin>:1:1: the file is over")
    assert refused("latency", "-", stdin=b"").startswith("<stdin>:1:1: schema_version: missing key.")


def test_a_file_that_never_ends_is_given_up(refused: Refused) -> None:
    assert refused("capacity", "/dev/zero").startswith("/dev/zero:1:1: the file is over 2,000,000 bytes")


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="no memory of its own below /dev")
def test_a_pipe_that_nobody_writes_is_not_waited_for_below_dev_either(refused: Refused) -> None:
    with TemporaryDirectory(dir="/dev/shm") as folder:
        path = f"{folder}/pipe.toml"
        os.mkfifo(path)
        # As a process: it would wait for ever.
        assert refused("capacity", path, env={}) == f"{path}: is a named pipe; give a regular file"


CLOSED = """
import os, sys
os.execvp("sh", ["sh", "-c", 'exec "$0" -m busplan "$@" <&-', sys.executable, *sys.argv[1:]])
"""


def test_a_closed_standard_input_is_refused_in_words(refused: Refused) -> None:
    assert refused("capacity", "-", python=("-c", CLOSED)) == "<stdin>: standard input is closed"


LITTLE_MEMORY = """
import resource
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
"""


@pytest.mark.parametrize("part", ["a", r'"\""'])
def test_a_key_of_very_many_parts_is_refused_at_once(refused: Refused, tmp_path: Path, part: str) -> None:
    (tmp_path / "bad.toml").write_text(f"{'.'.join([part] * 19_000)} = 1\n", encoding="utf-8")
    said = refused("capacity", "bad.toml", cwd=tmp_path, env={"FORK_FIRST": LITTLE_MEMORY})
    assert said == "bad.toml:1:1: too many parts in a key (limit 20)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("most_bytes", "told"), [(150_000_000, "150 MB (ulimit -v), and busplan needs 200"), (250_000_000, "")]
)
def test_too_little_memory_is_no_verdict(tmp_path: Path, most_bytes: int, told: str) -> None:
    # A log whose frames need more than 250 MB, and a circle whose linear algebra needs more than 150 MB.
    with (tmp_path / "long.log").open("w", encoding="utf-8") as file:
        file.writelines(
            f"({place / 2000:.6f}) can0 {0x100 + place % 20:03X}#1122334455667788\n" for place in range(600_000)
        )
    arguments = ("circle-test", "paper-1ms") if told else ("import", "long.log", "-o", "machine.toml")
    limit = LITTLE_MEMORY.replace("(2 << 30, 2 << 30)", f"({most_bytes}, {most_bytes})")
    done = subprocess.run(
        [sys.executable, "-c", f"{limit}\nfrom busplan.__main__ import main\nmain()", *arguments],
        check=False,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("not enough memory")
    assert told in done.stderr
    assert not (tmp_path / "machine.toml").exists()
