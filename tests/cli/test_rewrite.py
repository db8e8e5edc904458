"""Files that a command changes: what they are they stay, and what two runs write at once is there in the end."""

import json
import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, flock
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from busplan import files
from busplan.cli import rewrite

Run = Callable[..., Any]
Refused = Callable[..., str]

SHIPPED = Path(__file__).parents[2] / "profiles"
TABLE = str(SHIPPED / "table-1.csv")
CHANGES = {
    "plan": ("plan", "p.toml", "--nodes", "4", "--apply"),
    "calibrate": ("calibrate", "p.toml", TABLE, "--apply"),
    "baseline": ("check", "other.toml", "--no-circle", "--baseline", "b.json", "--update-baseline"),
}
"""Each changes p.toml, but for the last, which changes b.json."""


def profile() -> str:
    """A shipped profile with a short execution table: a plan searches the largest payload over all that it holds."""
    text = (SHIPPED / "paper-1ms.toml").read_text(encoding="utf-8")
    for key in ("payload_bytes", "time_us"):
        text = re.sub(rf"^({key} = \[[^,]+, [^,]+, [^,]+, [^,]+).*\]$", r"\1]", text, flags=re.MULTILINE)
    return text


class Change(NamedTuple):
    """A command, and the file that it changes."""

    command: tuple[str, ...]
    path: Path


@pytest.fixture(params=CHANGES)
def change(request: pytest.FixtureRequest, tmp_path: Path, run: Run) -> Change:
    """A command, beside the file that it changes."""
    text = profile()
    (tmp_path / "other.toml").write_text(text, encoding="utf-8")
    if request.param == "baseline":
        run("check", "paper-4ms", "--no-circle", "--baseline", "b.json", "--update-baseline", cwd=tmp_path)
        return Change(CHANGES[request.param], tmp_path / "b.json")
    (tmp_path / "p.toml").write_text(text, encoding="utf-8")
    return Change(CHANGES[request.param], tmp_path / "p.toml")


KILLED = """
import os, sys
from itertools import count
from pathlib import Path
from busplan.__main__ import main

def child(last):
    # Killed before the last of some steps that change files; gives whether it had fewer.
    pid = os.fork()
    if pid:
        return os.WIFEXITED(os.waitpid(pid, 0)[1])
    steps = count(1)

    def step(*_):
        if next(steps) == last:
            os.kill(os.getpid(), 9)

    def heard(event, arguments):
        writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
        if writes or event in ("os.link", "os.rename", "os.remove", "os.truncate"):
            step()

    synced = os.fsync
    os.fsync = lambda descriptor: (step(), synced(descriptor))
    sys.addaudithook(heard)
    try:
        main()
    finally:
        os._exit(0)

path, sys.argv = Path(sys.argv[1]), ["busplan", *sys.argv[2:]]
before = path.read_bytes()
try:
    main()  # which loads what each child has
except SystemExit as leaving:
    assert not leaving.code
after = path.read_bytes()
assert after != before
for number in count(1):
    path.write_bytes(before)
    whole = child(number)
    assert path.read_bytes() in (before, after)
    if whole:
        assert path.read_bytes() == after
        break
print(number)
"""
REPORT = ("check", "other.toml", "--no-circle", "--format", "json", "-o", "report")


@pytest.mark.slow
@pytest.mark.parametrize("command", [*CHANGES.values(), REPORT], ids=[*CHANGES, "report"])
def test_a_kill_at_any_step_leaves_one_file_or_the_other(run: Run, tmp_path: Path, command: tuple[str, ...]) -> None:
    for name in ("other.toml", "p.toml"):
        (tmp_path / name).write_text(profile(), encoding="utf-8")
    run("check", "paper-4ms", "--no-circle", "--baseline", "b.json", "--update-baseline", cwd=tmp_path)
    (tmp_path / "report").write_text("old", encoding="utf-8")
    path = {"check": "b.json"}.get(command[0], "p.toml") if command is not REPORT else "report"
    done = run(path, *command, python=("-c", KILLED), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) > 3  # the file is opened, synced and named


def test_mode_and_links_stay(change: Change, tmp_path: Path, run: Run) -> None:
    (tmp_path / "far").mkdir()
    real = change.path.rename(tmp_path / "far" / f"real{change.path.suffix}")
    change.path.symlink_to(f"far/{real.name}")
    real.chmod(0o640)
    before = real.read_bytes()
    done = run(*change.command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert real.read_bytes() != before
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    assert change.path.is_symlink()
    assert list(real.parent.iterdir()) == [real]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files to others")
def test_the_owner_stays(change: Change, tmp_path: Path, run: Run) -> None:
    path = change.path
    os.chown(path, 1234, 5678)
    before = path.read_bytes()
    assert run(*change.command, cwd=tmp_path).returncode == 0
    assert path.read_bytes() != before
    assert (path.stat().st_uid, path.stat().st_gid) == (1234, 5678)


def test_a_file_whose_owner_cannot_be_kept_is_left(
    change: Change, tmp_path: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = change.path
    before = path.read_bytes()
    status = list(path.stat())
    status[stat.ST_UID] += 1
    monkeypatch.setattr(rewrite, "require_changeable", lambda _: os.stat_result(status))

    def forbidden(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "fchown", forbidden)
    said = refused(*change.command, cwd=tmp_path)
    assert f"{path.name}: belongs to user {status[stat.ST_UID]} and group" in said
    assert path.read_bytes() == before
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted(["other.toml", path.name])


@pytest.mark.parametrize("what", ["hard link", "read-only", "no file"])
def test_what_would_be_another_file_is_refused_by_name(
    change: Change, what: str, tmp_path: Path, refused: Refused
) -> None:
    path = change.path
    before = path.read_bytes()
    if what == "hard link":
        (tmp_path / "q.toml").hardlink_to(path)
        words = f"{path.name}: has 2 hard links, which replacing it would break; copy it and change the copy"
    elif what == "read-only":
        path.chmod(0o444)
        words = f"{path.name}: is read-only (mode 0444) and stays as it is; make it writable first"
    else:
        path.unlink()
        os.mkfifo(path)
        words = f"{path.name}: is not a regular file, so it cannot be changed"
    assert refused(*change.command, cwd=tmp_path) == words
    assert path.is_fifo() or path.read_bytes() == before


@contextmanager
def other_run(folder: Path, write: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Another run in a folder, which has its lock; once that has been asked for, it writes, and ends."""
    descriptor = os.open(folder, os.O_RDONLY)
    flock(descriptor, LOCK_EX)
    locked, held = files.lock, [descriptor]

    def ask(wanted: int) -> bool:
        is_ours = locked(wanted)
        if held:
            assert not is_ours
            write()
            os.close(held.pop())
        return is_ours

    monkeypatch.setattr(rewrite, "lock", ask)
    yield
    assert not held


def test_records_that_are_written_at_once_are_all_kept(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "base.json"
    given = ("--no-circle", "--baseline", "base.json", "--update-baseline")
    run("check", "paper-1ms", *given, cwd=tmp_path)
    theirs = json.loads(path.read_text(encoding="utf-8"))
    theirs["profiles"]["theirs.toml"] = {}
    (tmp_path / "theirs.toml").write_text(profile(), encoding="utf-8")
    with other_run(tmp_path, lambda: path.write_text(json.dumps(theirs), encoding="utf-8"), monkeypatch):
        assert run("check", "paper-4ms", *given, cwd=tmp_path).returncode == 0
    found = json.loads(path.read_text(encoding="utf-8"))["profiles"]
    assert sorted(found) == ["paper-1ms", "paper-4ms", "theirs.toml"]


@pytest.mark.parametrize("command", ["plan", "calibrate"])
def test_what_another_run_writes_into_a_profile_is_not_lost(
    command: str, tmp_path: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "p.toml"
    text = profile()
    path.write_text(text, encoding="utf-8")
    with other_run(tmp_path, lambda: path.write_text(f"# theirs\n{text}", encoding="utf-8"), monkeypatch):
        said = refused(*CHANGES[command], cwd=tmp_path)
    assert said == "--apply: p.toml was changed meanwhile, and stays as it is now; run the command again"
    assert path.read_text(encoding="utf-8") == f"# theirs\n{text}"


def test_a_run_that_never_ends_is_not_waited_for_forever(
    change: Change, tmp_path: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rewrite, "PATIENCE_S", 0.1)
    before = change.path.read_bytes()
    descriptor = os.open(tmp_path, os.O_RDONLY)
    flock(descriptor, LOCK_EX)
    assert "another run has been changing a file of this folder for 0.1 s" in refused(*change.command, cwd=tmp_path)
    os.close(descriptor)
    assert change.path.read_bytes() == before


def test_a_file_system_without_locks_is_said(
    change: Change, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(*_: object) -> None:
        raise OSError(9, "Bad file descriptor")

    monkeypatch.setattr("fcntl.flock", no_locks)
    done = run(*change.command, cwd=tmp_path)
    assert done.returncode == 0
    assert (
        f"{change.path.name}: its folder cannot be locked (Bad file descriptor); let no other run write it"
        in done.stderr
    )
