"""What tests of several rooms share: a real git repository; the program as a process, and called in this one."""

import gc
import os
import pty
import subprocess
import sys
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import chdir
from functools import partial
from io import BufferedWriter, BytesIO, FileIO, TextIOWrapper
from pathlib import Path
from shutil import copytree
from threading import Thread
from typing import IO, Any
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings

from busplan.cli import run as run_command_line
from tests.registers import QUICK

Git = Callable[..., bytes]
Run = Callable[..., "subprocess.CompletedProcess[str]"]

# Modules, and tests with their assertions, are compiled once and not in each process again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
os.environ.pop("PYTHONUNBUFFERED", None)  # whoever tests it sets it
# Matrices are small, and every processor has a test of its own.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The few examples are the same in each run, so that whoever runs the tests first sees what the last one saw; a slow one
# is no failure where the machine is shared. More of them, as continuous integration has: --hypothesis-profile=many.
# New ones, after a change of a computation, and at times without any: --hypothesis-profile=thorough.
# `tests.registers.at_least` gives a test more or fewer than others, and random machines their number.
EASY = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
settings.register_profile("quick", EASY, max_examples=QUICK, derandomize=True)
settings.register_profile("many", EASY, max_examples=4 * QUICK, derandomize=True)
settings.register_profile("thorough", EASY, max_examples=500)
settings.load_profile("quick")


@pytest.hookimpl(wrapper=True)
def pytest_collect_file() -> Generator[None, list[pytest.Collector], list[pytest.Collector]]:
    """Tests have no doctests: nothing is searched for them, and no helper is loaded, in every worker."""
    return [found for found in (yield) if type(found) is pytest.Module]


def pytest_collection_finish() -> None:
    """What is there for all tests is no garbage, and is looked through no more."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def run_git(*arguments: str, cwd: Path) -> bytes:
    """Run git, untouched by the user's own settings; gives what it writes."""
    outside = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    settings = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
    author = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "init.defaultBranch=main")
    return subprocess.run(
        ["git", *author, *arguments], check=True, cwd=cwd, env={**outside, **settings}, capture_output=True
    ).stdout


@pytest.fixture
def git(tmp_path: Path) -> Git:
    """Run git in a new repository."""
    folder = tmp_path / "repository"
    folder.mkdir()
    run_git("init", "--quiet", "--template=", cwd=folder)
    return partial(run_git, cwd=folder)


@pytest.fixture
def repository(git: Git, committed: Path, tmp_path: Path) -> Path:
    """A repository of the test's own, with what is committed in every one."""
    del git  # which has made the folder
    return Path(copytree(committed, tmp_path / "repository", symlinks=True, dirs_exist_ok=True))


@pytest.fixture(scope="session")
def committed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository with two commits: profiles/line.toml at 4 ms, then at 1 ms, tagged v1 and main; and odd files."""
    folder = tmp_path_factory.mktemp("committed")
    git = partial(run_git, cwd=folder)
    git("init", "--quiet", "--template=")
    line = folder / "profiles" / "line.toml"
    line.parent.mkdir()
    line.write_text(LINE, encoding="utf-8")
    (folder / "gone").mkdir()
    (folder / "gone" / "old.toml").write_text(LINE, encoding="utf-8")
    (folder / "link.toml").symlink_to("profiles/line.toml")
    (folder / "lost.toml").symlink_to("nowhere.toml")
    (folder / "out.toml").symlink_to("/etc/passwd")
    (folder / "broken.toml").write_text(LINE.replace("nodes = 2", "nodes = 0"), encoding="utf-8")
    (folder / "large.toml").write_text("#" * 2_000_001, encoding="utf-8")
    git("add", ".")
    git("commit", "--quiet", "--message", "one")
    git("tag", "v1")
    line.write_text(LINE.replace("4000", "1000"), encoding="utf-8")
    git("rm", "--quiet", "-r", "gone")
    git("commit", "--quiet", "--all", "--message", "two")
    return folder


LINE = """\
schema_version = 1
name = "line"
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
kind = "linear"
base_us = 30
per_byte_us = 0.35
"""


# --- the program --------------------------------------------------------------------------------------


def environment(**changes: str) -> dict[str, str]:
    """The user's environment without what would change colours, encodings or widths."""
    dropped = (
        "NO_COLOR",
        "FORCE_COLOR",
        "CLICOLOR",
        "COLUMNS",
        "LINES",
        "PYTHONIO",
        "PYTHONUTF8",
        "LC_",
        "TERM",
        "TTY_",
        "BUSPLAN",
        "_BUSPLAN",
    )
    kept = {key: value for key, value in os.environ.items() if not key.startswith(dropped)}
    return {**kept, "LANG": "C.UTF-8", "TERM": "xterm-256color", **changes}


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """An executable `busplan`: the program as a process, without the time that an interpreter takes to load it."""
    folder = tmp_path_factory.mktemp("program")
    forks, path = Path(__file__).with_name("forks.py"), folder / "busplan"
    words = ["call", str(folder / "forks")]
    text = f"#!{sys.executable} -IS\nimport sys\nsys.argv[1:1] = {words}\nexec(open({str(forks)!r}).read())\n"
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)
    serve = [sys.executable, str(forks), "serve", str(folder / "forks")]
    with subprocess.Popen(
        serve, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder, env=environment()
    ) as server:
        assert server.stdout is not None
        assert server.stdout.readline() == b"ready\n"
        yield path
        assert server.stdin is not None
        server.stdin.close()


def run_busplan(
    *arguments: str,
    program: tuple[str | Path, ...],
    cwd: Path,
    stdin: str | bytes | None = None,
    env: Mapping[str, str] | None = None,
    stdout: int | IO[bytes] = subprocess.PIPE,
) -> "subprocess.CompletedProcess[str]":
    """Run the program to its end; the streams as text, bytes that are no UTF-8 escaped."""
    done = subprocess.run(
        [*program, *arguments],
        check=False,
        cwd=cwd,
        env=environment(**(env or {})),
        input=stdin.encode() if isinstance(stdin, str) else stdin,
        stdin=subprocess.DEVNULL if stdin is None else None,
        stdout=stdout,
        stderr=subprocess.PIPE,
        timeout=300,
    )
    return subprocess.CompletedProcess(
        done.args,
        done.returncode,
        (done.stdout or b"").decode(errors="backslashreplace"),
        done.stderr.decode(errors="backslashreplace"),
    )


CLOSED = -1
"""Descriptor of a stream that the caller has closed."""


def opened(descriptor: int, *, encoding: str) -> TextIOWrapper | None:
    """A standard stream as an interpreter makes it of a descriptor."""
    if descriptor == CLOSED:
        return None
    return TextIOWrapper(BufferedWriter(FileIO(descriptor, "wb", closefd=False)), encoding=encoding)


def run_inside(
    *arguments: str,
    cwd: Path,
    stdin: str | bytes | None = None,
    encoding: str = "utf-8",
    variables: Mapping[str, str] | None = None,
    stdout: int | None = None,
    stderr: int | None = None,
) -> "subprocess.CompletedProcess[str]":
    """Run the program's command line in this process: what hundreds of messages need no interpreter each for.

    Standard output and standard error have an encoding, as PYTHONIOENCODING sets it. Each may be a descriptor, which
    the program gets as an interpreter would open it, or CLOSED; what it takes is not in the answer.
    """
    content = stdin.encode() if isinstance(stdin, str) else stdin or b""
    written = BytesIO(), BytesIO()
    stdin_stream = TextIOWrapper(BytesIO(content), encoding="utf-8")
    out, err = (
        TextIOWrapper(kept, encoding=encoding) if descriptor is None else opened(descriptor, encoding=encoding)
        for kept, descriptor in zip(written, (stdout, stderr), strict=True)
    )
    with (
        chdir(cwd),
        mock.patch.dict(os.environ, environment(**(variables or {})), clear=True),
        mock.patch.multiple(sys, argv=["busplan", *arguments], stdin=stdin_stream, stdout=out, stderr=err),
        pytest.raises(SystemExit) as leaving,
    ):
        run_command_line()
    for stream in (out, err):
        if stream is not None:
            stream.flush()
    code = leaving.value.code or 0
    assert isinstance(code, int)
    return subprocess.CompletedProcess(
        arguments, code, *(stream.getvalue().decode(errors="backslashreplace") for stream in written)
    )


def run_line(line: str, *, cwd: Path, program: Path) -> "subprocess.CompletedProcess[str]":
    """Run a line as it is typed into bash.

    Of a line that begins with one command of the program, bash says what its words are, and the program is called with
    them in this process; bash runs what reads its output.
    """

    def bash(script: str, *, check: bool = False, stdin: str = "") -> "subprocess.CompletedProcess[bytes]":
        path = f"{program.parent}{os.pathsep}{os.environ['PATH']}"
        return subprocess.run(
            ["bash", "-c", script],
            check=check,
            capture_output=True,
            cwd=cwd,
            env=environment(PATH=path),
            input=stdin.encode(),
            timeout=300,
        )

    first, _, rest = line.partition(" | ")
    said = ""
    if first.startswith("busplan ") and not set(first) & set("|&;<>\n"):
        words = bash(f"busplan() {{ printf '%s\\0' \"$@\"; }}\n{first}", check=True).stdout.split(b"\0")[:-1]
        done = run_inside(*map(os.fsdecode, words), cwd=cwd)
        if not rest:
            return done
        read, said = bash(rest, stdin=done.stdout), done.stderr
    else:
        read = bash(line)
    return subprocess.CompletedProcess(line, read.returncode, read.stdout.decode(), said + read.stderr.decode())


@pytest.fixture(scope="session")
def shell(program: Path) -> Run:
    """Run a line of documentation as it stands."""
    return partial(run_line, program=program)


@pytest.fixture(scope="session")
def no_compiler(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """Variables for a process whose interpreter, and that of its workers, starts as if no kernel had been compiled."""
    folder = tmp_path_factory.mktemp("no_compiler")
    text = 'import sys\nsys.modules["busplan.servo._kernel"] = None\n'
    (folder / "sitecustomize.py").write_text(text, encoding="utf-8")
    return {"PYTHONPATH": os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))}


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Run:
    """Run the program: as a process where a stream or the environment matters, else in this one.

    The same call twice is one run, unless it names a working directory or a stream. `inside` has more arguments of
    `run_inside`; `python` has those of an interpreter, where it matters, too.
    """
    home = tmp_path_factory.mktemp("cwd")
    known: dict[object, subprocess.CompletedProcess[str]] = {}

    def call(
        *arguments: str,
        cwd: Path | None = None,
        stdin: str | bytes | None = None,
        env: Mapping[str, str] | None = None,
        inside: Mapping[str, Any] | None = None,
        python: tuple[str, ...] | None = None,
        **options: object,
    ) -> "subprocess.CompletedProcess[str]":
        if python is not None:
            options["program"] = (sys.executable, *python)
        if options or env is not None:
            if "program" not in options:
                options["program"] = (request.getfixturevalue("program"),)
            return run_busplan(*arguments, cwd=cwd or home, stdin=stdin, env=env, **options)  # type: ignore[arg-type]
        if cwd is not None or stdin is not None or inside is not None:
            return run_inside(*arguments, cwd=cwd or home, stdin=stdin, **(inside or {}))
        if arguments not in known:
            known[arguments] = run_inside(*arguments, cwd=home)
        return known[arguments]

    return call


@pytest.fixture(scope="session")
def busplan(run: Run) -> Run:
    """Call the command line in this process, with whatever is written as an argument."""

    def call(
        *arguments: object, cwd: Path, stdin: str | None = None, **inside: object
    ) -> "subprocess.CompletedProcess[str]":
        return run(*map(str, arguments), cwd=cwd, stdin=stdin, inside=inside)

    return call


@pytest.fixture(scope="session")
def refused(run: Run) -> Callable[..., str]:
    """Run what must be refused: exit 2, no document, no traceback; gives what is said."""

    def call(*arguments: str, **options: object) -> str:
        done = run(*arguments, **options)
        assert done.returncode == 2, done
        assert done.stdout == ""
        assert done.stderr.endswith("\n")
        assert "Traceback" not in done.stderr
        assert "busplan itself failed" not in done.stderr
        return done.stderr.removesuffix("\n")

    return call


@pytest.fixture(scope="session")
def on_terminal(run: Run, request: pytest.FixtureRequest) -> Callable[..., tuple[int, str]]:
    """Run the program with a terminal for its standard output and error; gives exit code and what the terminal got.

    In this process, as `run` does, unless a process is asked for, which may have the keyboard, too.
    """

    def call(
        *arguments: str,
        cwd: Path,
        env: Mapping[str, str] | None = None,
        process: bool = False,
        keyboard: bool = False,
    ) -> tuple[int, str]:
        ours, theirs = pty.openpty()
        shown = bytearray()
        reading = Thread(target=_read_all, args=(ours, shown))
        reading.start()
        try:
            if process:
                code = subprocess.run(
                    [request.getfixturevalue("program"), *arguments],
                    check=False,
                    cwd=cwd,
                    env=environment(**(env or {})),
                    stdin=theirs if keyboard else subprocess.DEVNULL,
                    stdout=theirs,
                    stderr=theirs,
                    timeout=300,
                ).returncode
            else:
                inside = {"stdout": theirs, "stderr": theirs, "variables": env}
                code = run(*arguments, cwd=cwd, inside=inside).returncode
        finally:
            os.close(theirs)
            reading.join()
            os.close(ours)
        return code, shown.decode().replace("\r\n", "\n")

    return call


def _read_all(terminal: int, shown: bytearray) -> None:
    while piece := _read(terminal):
        shown += piece


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # how Linux says that the other side has gone
        return b""
