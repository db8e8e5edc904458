"""`busplan import` as a user types it, and what --update does to a profile."""

import os
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
    "take alone": (["slaves.txt", "--take", "file"], "--take: goes with --update"),
    "both": (["slaves.txt", "--update", "old.toml", "-o", "new.toml"], "give one of them"),
    "the same twice": (["slaves.txt", "slaves.txt"], "each once"),
    "no such file": (["gone.xml"], "gone.xml: no such file"),
    "a folder": (["."], ".: is a directory"),
    "over itself": (["old.toml", "--update", "old.toml"], "would overwrite old.toml, which is read"),
    "of another bus": (["slaveinfo.txt", "--update", "old.toml"], "old.toml is of can"),
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


def test_update_asks_which_value_counts_and_keeps_what_the_user_wrote(run: Run, folder: Path) -> None:
    run("import", "slaves.txt", "pdos.txt", "-o", "machine.toml", cwd=folder)
    path = folder / "machine.toml"
    old = path.read_text(encoding="utf-8")
    own = old.replace('name = "AX20"', 'name = "arms" # the two arms').replace("master_us = 40 ", "master_us = 25 ")
    own = own.replace("read_bytes = 8 ", "read_bytes = 10 ").replace("delay_us = 0.15 ", "# delay_us = 0.15")
    path.write_text(own, encoding="utf-8")
    asked = run("import", "slaves.txt", "pdos.txt", "--update", "machine.toml", cwd=folder)
    assert asked.returncode == 2
    assert asked.stderr.splitlines() == [
        "machine.toml and the files differ; --take file or --take profile says which counts:",
        "group.arms.read_bytes = 10 in machine.toml, 8 at pdos.txt:14",
    ]
    assert path.read_text(encoding="utf-8") == own
    kept = run("import", "slaves.txt", "pdos.txt", "--update", "machine.toml", "--take", "profile", cwd=folder)
    assert "kept: group.arms.read_bytes = 10 in machine.toml" in kept.stderr
    assert "added: group.DI04.delay_us = 0.15" in kept.stderr
    assert "read_bytes = 10 " in path.read_text(encoding="utf-8")
    taken = run("import", "slaves.txt", "pdos.txt", "--update", "machine.toml", "--take", "file", cwd=folder)
    assert taken.returncode == 0
    new = path.read_text(encoding="utf-8")
    assert 'name = "arms" # the two arms' in new
    assert "master_us = 25 " in new
    assert "# published: 64 bits, pdos.txt:14" in new
    assert "# was" not in new
    again = run("import", "slaves.txt", "pdos.txt", "--update", "machine.toml", cwd=folder)
    assert again.returncode == 0
    assert path.read_text(encoding="utf-8") == new


def test_update_brings_messages_of_a_database_into_a_profile(run: Run, folder: Path) -> None:
    run("init", "line", "--bus", "can", "--nodes", 2, "--axes", 2, cwd=folder)
    path = folder / "line.toml"
    text = path.read_text(encoding="utf-8").replace("bit_rate_kbit_s = 1000", "bit_rate_kbit_s = 500")
    path.write_text(text.replace("\n", os.linesep), encoding="utf-8")
    assert run("import", "machine.dbc", "--update", "line.toml", cwd=folder).returncode == 0
    new = path.read_text(encoding="utf-8")
    assert new.startswith(text.rstrip())
    assert new[len(text.rstrip()) :].split() == [
        *("[[message]]", "name", "=", '"Pressure"', "identifier", "=", "256", "#", "published:", "0x100,"),
        *("machine.dbc:9", "payload_bytes", "=", "8", "#", "published:", "machine.dbc:9"),
        *("period_us", "=", "20000", "#", "published:", "machine.dbc:9"),
        *("[[message]]", "name", "=", '"Foreign"', "identifier", "=", "419361278", "#", "published:", "0x18fef1fe,"),
        *("machine.dbc:15", "identifier_bits", "=", "29", "#", "published:", "machine.dbc:15"),
        *("payload_bytes", "=", "8", "#", "published:", "machine.dbc:15"),
        *("period_us", "=", "100000", "#", "published:", "machine.dbc:15"),
    ]
    # The same again, with another name and period: it is known by its identifier.
    path.write_text(new.replace('"Pressure"', '"oil"').replace("20000", "10000"), encoding="utf-8")
    done = run("import", "machine.dbc", "--update", "line.toml", "--take", "file", cwd=folder)
    assert "changed: message.oil.period_us = 10000 in line.toml, 20000 at machine.dbc:9" in done.stderr


def test_update_keeps_line_ends_and_mark(run: Run, folder: Path) -> None:
    run("import", "slaves.txt", "pdos.txt", "-o", "machine.toml", cwd=folder)
    path = folder / "machine.toml"
    old = path.read_bytes().replace(b"\n", b"\r\n")
    path.write_bytes(b"\xef\xbb\xbf" + old.replace(b"write_bytes = 6 ", b"write_bytes = 7 "))
    done = run("import", "slaves.txt", "pdos.txt", "--update", "machine.toml", "--take", "file", cwd=folder)
    assert done.returncode == 0
    new = path.read_bytes()
    assert new.startswith(b"\xef\xbb\xbf")
    assert new.count(b"\r\n") == new.count(b"\n") == old.count(b"\n")
    assert b"write_bytes = 6" in new


def test_groups_that_do_not_match_are_refused(run: Run, folder: Path) -> None:
    run("import", "slaves.txt", "pdos.txt", "-o", "machine.toml", cwd=folder)
    path = folder / "machine.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text[: text.rindex("[[group]]")], encoding="utf-8")
    done = run("import", "slaves.txt", "pdos.txt", "--update", "machine.toml", cwd=folder)
    assert done.returncode == 2
    assert "has the groups CP10, DI04, the files give CP10, DI04, AX20: which is which is not clear" in done.stderr
