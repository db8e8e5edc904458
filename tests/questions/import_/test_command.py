"""`busplan import` as a user types it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

FILES: Final = Path(__file__).parent / "files"
Run = Callable[..., Any]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for path in FILES.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def test_two_commands_go_from_files_to_capacity_map_and_check(run: Run, folder: Path) -> None:
    done = run("import", "slaves.txt", "pdos.txt", "-o", "machine.toml", cwd=folder)
    assert (done.returncode, done.stdout) == (0, "")
    wrote, *card, unknown, following = done.stderr.splitlines()
    assert (wrote, following) == ("wrote machine.toml", "next: busplan capacity machine.toml")
    assert unknown.startswith("Not known, so assumed: bus.distributed_clocks = true, bus.mailbox_polls = 1")
    own = run("capacity", "machine.toml", cwd=folder)
    assert own.stdout.partition("\n\n")[0].splitlines() == card
    for command in (("map", "machine.toml"), ("check", "machine.toml")):
        assert run(*command, cwd=folder).returncode == 0


def test_without_a_name_the_profile_goes_to_standard_output(run: Run, folder: Path) -> None:
    done = run("import", "slaves.txt", "pdos.txt", cwd=folder)
    piped = run("capacity", "-", stdin=done.stdout, cwd=folder)
    assert (done.returncode, piped.returncode) == (0, 0)
    assert piped.stdout.splitlines()[0] in done.stderr.splitlines()
    from_input = run("import", "-", stdin=(FILES / "slaveinfo.txt").read_text(encoding="utf-8"), cwd=folder)
    assert 'name = "machine"' in from_input.stdout


REFUSED = {
    "an input": (["slaves.txt", "pdos.txt", "-o", "old.toml"], "old.toml: already there"),
    "another ending": (["slaves.txt", "-o", "new.txt"], "expected a name ending in .toml"),
    "the same twice": (["slaves.txt", "slaves.txt"], "each once"),
    "no such file": (["gone.xml"], "gone.xml: no such file"),
    "a folder": (["."], ".: is a directory"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_done_writes_nothing(case: str, run: Run, folder: Path) -> None:
    arguments, words = REFUSED[case]
    assert run("import", "axis-5.dcf", "-o", "old.toml", cwd=folder).returncode == 0
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    done = run("import", *arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
