"""Every way to standard output, on descriptors that take a part of what they are given, and in UTF-8."""

import json
import os
import resource
import sys
import time
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

Run = Callable[..., Any]

DOCUMENT, TABLE = ("capacity", "paper-4ms", "--format", "json"), ("latency", "paper-4ms")
LONG = ("schema",)
MIXED = """\
schema_version = 1
name = "Fräse 日本"
bus = { kind = "ieee1394", speed = "S400", nodes = 2 }
cycle.period_us = 4000
payload = { read_bytes = 12, write_bytes = 12 }
node = { axes = 4, execution = { kind = "linear", base_us = 30, per_byte_us = 0.35 } }
"""


@pytest.mark.parametrize("arguments", [DOCUMENT, TABLE, ("sweep", "--help")], ids=["document", "table", "help"])
def test_a_file_that_takes_a_part_ends_with_exit_2_and_a_message(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...]
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # a compiled module would be cut short, too
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    with (tmp_path / "out").open("wb") as file:
        resource.setrlimit(resource.RLIMIT_FSIZE, (512, before[1]))
        try:
            done = run(*arguments, inside={"stdout": file.fileno()})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert done.returncode == 2
    assert "cannot be written: File too large\n" in done.stderr
    assert (tmp_path / "out").stat().st_size == 512


def test_a_slow_reader_of_a_pipe_that_does_not_block_gets_every_byte(run: Run) -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    got = bytearray()
    reader = Thread(target=read_slowly, args=(reading, got))
    reader.start()
    try:
        done = run(*LONG, inside={"stdout": writing})
    finally:
        os.close(writing)
        reader.join()
        os.close(reading)
    assert done.returncode == 0, done.stderr
    assert got.decode() == run(*LONG).stdout
    assert len(got) > 1 << 16  # more than a pipe holds


def read_slowly(descriptor: int, got: bytearray) -> None:
    while piece := os.read(descriptor, 8192):
        got += piece
        time.sleep(0.001)


# --- encodings --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("capacity", "-", "--format", "csv"),
        ("sweep", "-", "--vary", "bus.nodes=1:2", "--format", "json"),
        ("timeline", "-", "--format", "svg"),
        ("check", "-", "--stdin-filename", "größe.toml", "--format", "junit"),
    ],
    ids=" ".join,
)
def test_a_document_is_utf_8_whatever_the_locale(run: Run, arguments: tuple[str, ...]) -> None:
    mine, theirs = (run(*arguments, stdin=MIXED, inside={"encoding": one}) for one in ("utf-8", "ascii"))
    assert mine.stdout == theirs.stdout
    assert "Fräse 日本" in mine.stdout or "größe" in mine.stdout or arguments[-1] == "csv"
    assert "\\x" not in mine.stdout
    if arguments[-1] in {"junit", "svg"}:
        ET.fromstring(theirs.stdout.encode())
    if arguments[-1] == "json":
        json.loads(theirs.stdout)


# --- standard output by its name --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("manual", "limits"),
        ("check", "paper-4ms", "--no-circle", "--format", "json"),
        ("sweep", "paper-4ms", "--vary", "bus.nodes=1:3", "--format", "csv"),
        ("timeline", "paper-4ms", "--format", "svg"),
    ],
    ids=" ".join,
)
def test_a_dash_is_standard_output(run: Run, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    named, left_out = run(*arguments, "-o", "-", cwd=tmp_path), run(*arguments, cwd=tmp_path)
    assert (named.returncode, named.stdout, named.stderr) == (0, left_out.stdout, left_out.stderr)
    assert named.stdout
    assert list(tmp_path.iterdir()) == []


def test_plan_sends_the_profile_down_the_pipe_and_the_report_past_it(run: Run, tmp_path: Path) -> None:
    asked = ("plan", "paper-1ms")
    piped = run(*asked, "-o", "-", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert run(*asked, "-o", "new.toml", cwd=tmp_path).returncode == piped.returncode == 0
    # A file is a plan with a name of its own.
    profile, new = tomllib.loads(piped.stdout), tomllib.loads((tmp_path / "new.toml").read_text(encoding="utf-8"))
    assert (profile.pop("name"), new.pop("name")) == ("paper-1ms", "new")
    assert new.pop("description").startswith("A plan of paper-1ms")
    assert profile.pop("description").startswith("The two-axis circle")
    assert profile == new
    assert piped.stderr == run(*asked, cwd=tmp_path).stdout


def test_no_bytes_go_to_a_terminal(on_terminal: Callable[..., tuple[int, str]], tmp_path: Path) -> None:
    code, shown = on_terminal("timeline", "paper-4ms", "--format", "png", cwd=tmp_path)
    assert (code, shown) == (
        2,
        "--format png: is not for a terminal; give -o FILE.png, or use a pipe\n",
    )


def test_a_working_folder_that_is_gone_is_said(run: Run, tmp_path: Path) -> None:
    gone = {"FORK_FIRST": "import os; os.rmdir(os.getcwd())"}
    sweep = ("sweep", "paper-4ms", "--vary", "bus.nodes=1:3", "-o", "rows.csv")
    for number, arguments in enumerate((sweep, ("init", "x"))):
        folder = tmp_path / str(number)
        folder.mkdir()
        done = run(*arguments, cwd=folder, env=gone)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == "the working folder no longer exists; change into one that does\n"
