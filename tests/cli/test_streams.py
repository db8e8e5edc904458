"""Where the program writes: colours, encodings, full disks, closed pipes, and what it loads to do so."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from fcntl import ioctl
from pathlib import Path
from termios import FIONREAD
from typing import IO, Any

import pytest

from tests.registers import COMMANDS

Run = Callable[..., Any]
OnTerminal = Callable[..., tuple[int, str]]

ESCAPE = "\x1b"
COLOURS = tuple(f"{ESCAPE}[{style}{colour}m" for style in ("", "1;") for colour in range(30, 38))
REPORTS = [("capacity", "paper-4ms"), ("latency", "paper-4ms")]
QUICK = [("capacity", "paper-4ms"), ("profiles",), ("capacity", "paper-4ms", "--format", "json")]


def on_full_disk() -> IO[bytes]:
    return Path("/dev/full").open("wb")


# --- the program as its users call it ---------------------------------------------------------------------


def test_a_process_says_what_the_command_line_says(run: Run) -> None:
    # The other tests call the command line without an interpreter of its own where none is needed.
    for arguments in (("capacity", "paper-4ms"), ("capacity", "nope")):
        inside, process = run(*arguments), run(*arguments, python=("-m", "busplan"))
        assert (process.returncode, process.stdout, process.stderr) == (inside.returncode, inside.stdout, inside.stderr)


# --- colours ----------------------------------------------------------------------------------------------


def test_a_terminal_gets_colours_and_under_no_color_none(on_terminal: OnTerminal, tmp_path: Path) -> None:
    fits = ("capacity", "paper-4ms")
    for arguments in (fits, (*fits, "--period", "1us")):
        code, shown = on_terminal(*arguments, cwd=tmp_path, process=arguments == fits)
        assert code == 0
        assert any(colour in shown for colour in COLOURS)
        code, shown = on_terminal(*arguments, cwd=tmp_path, env={"NO_COLOR": "1"})
        assert code == 0
        assert not any(colour in shown for colour in COLOURS)
    assert ESCAPE not in on_terminal("capacity", "paper-4ms", cwd=tmp_path, env={"TERM": "dumb"})[1]


def test_a_terminal_and_a_pipe_get_the_same_figures(run: Run, on_terminal: OnTerminal, tmp_path: Path) -> None:
    for arguments in REPORTS:
        for columns in ("40", "80"):
            _, shown = on_terminal(*arguments, "--all", cwd=tmp_path, env={"TERM": "dumb", "COLUMNS": columns})
            # A terminal alone names the next commands, with the page that one of them writes.
            both = (shown.replace("paper-4ms.html", ""), run(*arguments, "--all").stdout)
            here, there = ({word for word in text.split() if re.search(r"\d", word)} for text in both)
            assert here == there


def test_what_to_ask_next_is_of_the_period_that_was_asked_for(on_terminal: OnTerminal, tmp_path: Path) -> None:
    _, shown = on_terminal("capacity", "paper-4ms", "--period", "300us", cwd=tmp_path, env={"TERM": "dumb"})
    for words in ("capacity paper-4ms --period 300us --sensitivity", "plan paper-4ms --period 300us"):
        assert f"busplan {words}" in shown
    _, shown = on_terminal("capacity", "paper-4ms", "--period", "4ms", cwd=tmp_path, env={"TERM": "dumb"})
    assert "busplan circle-test paper-4ms\n" in shown


def test_a_terminal_breaks_no_row_and_says_what_it_leaves_out(on_terminal: OnTerminal, tmp_path: Path) -> None:
    plan = ("plan", "paper-1ms", "--axes", "16")
    _, shown = on_terminal(*plan, cwd=tmp_path, env={"TERM": "dumb", "COLUMNS": "40"})
    assert max(map(len, shown.splitlines())) <= 40
    assert "Not shown: columns largest term, safe nodes, safe axes. --all shows all." in " ".join(shown.split())


PROFILE = """\
schema_version = 1
name = "NAME"
bus = { kind = "ieee1394", speed = "S400", nodes = 2 }
cycle.period_us = 4000
payload = { read_bytes = 12, write_bytes = 12 }
node = { axes = 4, execution = { kind = "linear", base_us = 30, per_byte_us = 0.35 } }
"""


# --- encodings --------------------------------------------------------------------------------------------


def test_a_stream_of_ascii_gets_escapes_instead_of_a_failure(run: Run) -> None:
    text, ascii_only = PROFILE.replace("NAME", "größe 日本"), {"encoding": "ascii"}
    done = run("capacity", "-", stdin=text, inside=ascii_only)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(r"gr\u00f6\u00dfe \u65e5\u672c  IEEE 1394, 2 nodes, 8 axes, 4 ms ")
    done = run("capacity", "größe.toml", inside=ascii_only)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(r"gr\u00f6\u00dfe.toml: no such file")


def test_json_on_a_stream_without_utf8_is_json(run: Run, tmp_path: Path) -> None:
    name = "größe 日本 \U0001f600 \\"
    text = PROFILE.replace("NAME", name.replace("\\", "\\\\"))
    path = tmp_path / "out.json"
    with path.open("wb") as file:
        inside = {"encoding": "cp1252", "stdout": file.fileno()}
        done = run("capacity", "-", "--format", "json", stdin=text, inside=inside)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(path.read_text(encoding="utf-8"))["profile"] == name


# --- streams that do not take it --------------------------------------------------------------------------


def to(descriptor: int, arguments: tuple[str, ...]) -> dict[str, Any]:
    """Options of `run` for a standard output: one command is a process, whose interpreter ends without a word, too."""
    return {"stdout": descriptor} if arguments == QUICK[0] else {"inside": {"stdout": descriptor}}


@pytest.mark.parametrize(
    "arguments",
    [
        *QUICK,
        ("--version",),
        ("check", "--help"),
    ],
    ids=" ".join,
)
def test_a_full_disk_is_said_and_exits_2(run: Run, arguments: tuple[str, ...]) -> None:
    with on_full_disk() as full:
        done = run(*arguments, **to(full.fileno(), arguments))
    assert (done.returncode, done.stderr) == (2, "standard output cannot be written: No space left on device\n")


@pytest.fixture
def closed_pipe() -> Iterator[int]:
    """The writing end of a pipe that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


@pytest.mark.parametrize("arguments", QUICK, ids=" ".join)
def test_a_reader_that_has_gone_is_no_reason_to_complain(
    run: Run, closed_pipe: int, arguments: tuple[str, ...]
) -> None:
    done = run(*arguments, **to(closed_pipe, arguments))
    assert done.stderr == ""
    assert done.returncode == 2


CLOSED = """
import os, sys
os.execvp("sh", ["sh", "-c", 'exec "$0" -m busplan "$@" >&-', sys.executable, *sys.argv[1:]])
"""


@pytest.mark.parametrize("arguments", [*QUICK, ("--help",)], ids=" ".join)
def test_a_closed_standard_output_is_said_and_exits_2(run: Run, arguments: tuple[str, ...]) -> None:
    # Standard output is None where the interpreter found it closed.
    as_process, closed = {"python": ("-c", CLOSED)}, {"inside": {"stdout": -1}}
    done = run(*arguments, **(as_process if arguments == QUICK[0] else closed))
    assert (done.returncode, done.stderr) == (2, "standard output is closed\n")


@pytest.mark.parametrize(("arguments", "code"), [(("nope",), 2), (("capacity", "paper-4ms"), 0)])
def test_a_closed_standard_error_changes_no_exit_code_and_no_document(
    run: Run, arguments: tuple[str, ...], code: int
) -> None:
    as_process = {"python": ("-c", CLOSED.replace(">&-", "2>&-"))}
    closed = {"env": {"FORK_FIRST": "import os, sys; os.close(2); sys.stderr = sys.__stderr__ = None"}}
    done = run(*arguments, **(as_process if code else closed))
    assert (done.returncode, done.stderr) == (code, "")
    assert done.stdout == run(*arguments).stdout


def test_a_standard_error_that_takes_nothing_changes_no_exit_code(run: Run, program: Path, tmp_path: Path) -> None:
    for arguments, code in ((["capacity", "nope"], 2), (["nope"], 2), (["init", "x"], 0)):
        with on_full_disk() as full:
            done = run(*arguments, cwd=tmp_path, inside={"stderr": full.fileno()})
        assert (done.returncode, done.stdout) == (code, "")
    with on_full_disk() as full:
        process = subprocess.run(
            [program, "capacity", "nope"], check=False, cwd=tmp_path, stdout=subprocess.PIPE, stderr=full
        )
    assert (process.returncode, process.stdout) == (2, b"")


def left_in(pipe: IO[bytes]) -> int:
    """Bytes in a pipe that nobody has read yet."""
    count: int = int.from_bytes(ioctl(pipe.fileno(), FIONREAD, bytes(4)), sys.byteorder)
    return count


def state_of(pid: int) -> str:
    """State of a process: R where it runs, S where it waits."""
    return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]


def test_an_interrupt_exits_130_without_a_traceback(tmp_path: Path) -> None:
    # Whoever runs the tests in the background may ignore interrupts, and children inherit that.
    program = "import signal; signal.signal(2, signal.default_int_handler); from busplan.__main__ import main; main()"
    with subprocess.Popen(
        [sys.executable, "-c", program, "capacity", "-"],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdin is not None
        # More than a pipe holds, less than a profile may: when it is written, the program has begun to read.
        process.stdin.write(b"#" * 90_000)
        process.stdin.flush()
        # A signal between two reads waits for the next: so the program must sleep in one, with nothing left to read.
        end = time.monotonic() + 300
        while left_in(process.stdin) or state_of(process.pid) != "S":
            assert time.monotonic() < end
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=300) == 130
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.read() == b""
        assert b"Traceback" not in process.stderr.read()


# --- what is loaded ---------------------------------------------------------------------------------------

WITNESS = """
import json, sys
from busplan.__main__ import main
loaded = []
for line in sys.argv[1:]:
    sys.argv = ["busplan", *line.split()]
    try:
        main()
    except SystemExit as leaving:
        assert not leaving.code, line
    loaded.append(sorted(sys.modules))
sys.stderr.write(f"\\n{json.dumps(loaded)}")
"""
WORK = ("busplan.profile", "busplan.questions", "busplan.gate")
LIGHT = {"busplan.gate", "busplan.gate.formats", "busplan.profile", "busplan.profile.changes"}
"""The register of the gate's formats, where the choices of `check --format` are read; and what --set makes."""
EQUATIONS = ("capacity {}", "latency {}", "capacity {} --format json", "profiles")
NO_CIRCLE = (
    "check {} --no-circle",
    "plan {} --format csv",
    "diff {} paper-1ms",
    "timeline {} -o a.svg",
)


@pytest.mark.slow
def test_nothing_is_loaded_before_it_is_needed(run: Run, tmp_path: Path) -> None:
    helps = [f"{command} --help" for command in COMMANDS]
    plain = [line.format("paper-4ms") for line in (*EQUATIONS, *NO_CIRCLE)]
    lines = ["--version", "--help", *helps, *plain]
    rest = ["report paper-4ms --format markdown", "sweep paper-4ms --vary bus.nodes=1:3 --format csv"]
    done = run(*lines, *rest, cwd=tmp_path, python=("-c", WITNESS))
    assert done.returncode == 0, done.stderr
    loaded = {
        line: set(found) for line, found in zip((*lines, *rest), json.loads(done.stderr.splitlines()[-1]), strict=True)
    }
    assert "typer" in loaded["--help"]
    assert not loaded["--help"] & {"numpy", "pydantic", "rich", "tomllib", "tomli_w", "csv", "resvg_py"}
    # Typer reads the program's own options before a command's, and takes pydantic for it.
    assert not loaded[helps[-1]] & {"numpy", "rich", "tomllib", "tomli_w", "resvg_py"}
    assert not {name for name in loaded[helps[-1]] - LIGHT if name.startswith(WORK)}
    # The equations need no numpy, and nobody waits for it.
    assert "pydantic" in loaded[plain[-1]]
    assert not loaded[plain[len(EQUATIONS) - 1]] & {"numpy", "rich"}
    assert not loaded[plain[-1]] & {"numpy", "scipy", "jinja2", "resvg_py"}
    assert not loaded[rest[0]] & {"jinja2", "resvg_py"}
    assert not loaded[rest[1]] & {"pyarrow", "resvg_py", "distributed"}
