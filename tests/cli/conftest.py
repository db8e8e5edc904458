"""The program as a process, and as the same entry called in this one."""

import os
import pty
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import chdir
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import IO
from unittest import mock

import pytest

from busplan.cli import run as run_command_line

Run = Callable[..., "subprocess.CompletedProcess[str]"]


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


def run_busplan(
    *arguments: str,
    cwd: Path,
    stdin: str | bytes | None = None,
    env: Mapping[str, str] | None = None,
    stdout: int | IO[bytes] = subprocess.PIPE,
    python: tuple[str, ...] = ("-m", "busplan"),
) -> "subprocess.CompletedProcess[str]":
    """Run the program to its end; the streams as text, bytes that are no UTF-8 escaped."""
    done = subprocess.run(
        [sys.executable, *python, *arguments],
        check=False,
        cwd=cwd,
        env=environment(**(env or {})),
        input=stdin.encode() if isinstance(stdin, str) else stdin,
        stdin=subprocess.DEVNULL if stdin is None else None,
        stdout=stdout,
        stderr=subprocess.PIPE,
        timeout=30,
    )
    return subprocess.CompletedProcess(
        done.args,
        done.returncode,
        (done.stdout or b"").decode(errors="backslashreplace"),
        done.stderr.decode(errors="backslashreplace"),
    )


def run_inside(*arguments: str, cwd: Path, stdin: str | bytes | None = None) -> "subprocess.CompletedProcess[str]":
    """Run the program's command line in this process: what hundreds of messages need no interpreter each for."""
    content = stdin.encode() if isinstance(stdin, str) else stdin or b""
    written = BytesIO(), BytesIO()
    stdin_stream = TextIOWrapper(BytesIO(content), encoding="utf-8")
    stdout, stderr = (TextIOWrapper(stream, encoding="utf-8") for stream in written)
    with (
        chdir(cwd),
        mock.patch.dict(os.environ, environment(), clear=True),
        mock.patch.multiple(sys, argv=["busplan", *arguments], stdin=stdin_stream, stdout=stdout, stderr=stderr),
        pytest.raises(SystemExit) as leaving,
    ):
        run_command_line()
    stdout.flush()
    stderr.flush()
    code = leaving.value.code or 0
    assert isinstance(code, int)
    return subprocess.CompletedProcess(arguments, code, *(stream.getvalue().decode() for stream in written))


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run the program: as a process where a stream, the environment or the interpreter matters, else in this one.

    The same call twice is one run, unless it names a working directory or a stream.
    """
    home = tmp_path_factory.mktemp("cwd")
    known: dict[object, subprocess.CompletedProcess[str]] = {}

    def call(
        *arguments: str,
        cwd: Path | None = None,
        stdin: str | bytes | None = None,
        env: Mapping[str, str] | None = None,
        **options: object,
    ) -> "subprocess.CompletedProcess[str]":
        if options or env is not None:
            return run_busplan(*arguments, cwd=cwd or home, stdin=stdin, env=env, **options)  # type: ignore[arg-type]
        if cwd is not None or stdin is not None:
            return run_inside(*arguments, cwd=cwd or home, stdin=stdin)
        if arguments not in known:
            known[arguments] = run_inside(*arguments, cwd=home)
        return known[arguments]

    return call


@pytest.fixture(scope="session")
def busplan(run: Run) -> Run:
    """Call the command line in this process, with whatever is written as an argument."""

    def call(*arguments: object, cwd: Path, stdin: str | None = None) -> "subprocess.CompletedProcess[str]":
        return run(*map(str, arguments), cwd=cwd, stdin=stdin)

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
def on_terminal() -> Callable[..., tuple[int, str]]:
    """Run the program with a terminal for its standard output; gives exit code and what the terminal got."""

    def call(*arguments: str, cwd: Path, env: Mapping[str, str] | None = None) -> tuple[int, str]:
        ours, theirs = pty.openpty()
        try:
            with subprocess.Popen(
                [sys.executable, "-m", "busplan", *arguments],
                cwd=cwd,
                env=environment(**(env or {})),
                stdin=subprocess.DEVNULL,
                stdout=theirs,
                stderr=theirs,
            ) as process:
                os.close(theirs)
                shown = b""
                while piece := _read(ours):
                    shown += piece
                return process.wait(timeout=30), shown.decode().replace("\r\n", "\n")
        finally:
            os.close(ours)

    return call


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 65536)
    except OSError:  # how Linux says that the other side has gone
        return b""
