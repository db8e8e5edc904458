"""REV:path is the file that git has there, or one message that says why there is none."""

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import busplan
from busplan import BusplanError, Profile

Git = Callable[..., bytes]


def profile(argument: str) -> Profile:
    """The profile, as diff reads it."""
    return busplan.diff(argument, "paper-4ms").a.profile


def refusal(argument: str) -> str:
    with pytest.raises(BusplanError) as caught:
        profile(argument)
    assert len(caught.value.problems) == 1
    return caught.value.problems[0]


def period_us(argument: str) -> float:
    return profile(argument).cycle.period_us


def test_it_is_the_file_that_git_shows(repository: Path, git: Git, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(repository)
    for number, name in enumerate(["v1", "main~1", "HEAD^{/one}", "main", "@"]):
        argument = f"{name}:{'./' * (number % 2)}profiles/line.toml"
        Path("shown.toml").write_bytes(git("show", argument))
        assert profile(argument) == busplan.load_profile("shown.toml"), argument


def test_the_path_begins_at_the_current_folder(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(repository / "profiles")
    assert period_us("HEAD~1:line.toml") == 4000
    assert period_us("HEAD~1:./line.toml") == 4000
    assert period_us("HEAD~1:../profiles/line.toml") == 4000
    assert refusal("HEAD~1:profiles/line.toml") == (
        "HEAD~1:profiles/line.toml: no file of that name; of REV:path git says: "
        "fatal: path 'profiles/profiles/line.toml' does not exist in 'HEAD~1'"
    )


def test_the_repository_is_the_one_that_the_path_lies_in(
    repository: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert period_us("v1:repository/profiles/line.toml") == 4000
    assert period_us(f"v1:{repository}/profiles/line.toml") == 4000
    (tmp_path / "way").symlink_to(repository / "profiles")
    assert period_us("v1:way/line.toml") == 4000


def test_a_folder_that_is_gone_is_still_in_the_revision(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(repository)
    assert not (repository / "gone").exists()
    assert period_us("v1:gone/old.toml") == 4000
    assert "does not exist in 'HEAD'" in refusal("HEAD:gone/old.toml")


def test_links_are_followed_as_in_a_checkout(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(repository)
    assert (period_us("v1:link.toml"), period_us("HEAD:link.toml")) == (4000, 1000)
    for name in ("lost.toml", "out.toml"):
        assert refusal(f"v1:{name}") == (
            f"v1:{name}: leads to no file of revision v1; name the file itself, not a link"
        )


def test_what_is_there_under_that_name_comes_first(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(repository)
    text = (repository / "profiles" / "line.toml").read_text(encoding="utf-8")
    (repository / "HEAD:profiles").mkdir()
    (repository / "HEAD:profiles" / "line.toml").write_text(text.replace("1000", "777"), encoding="utf-8")
    assert period_us("HEAD:profiles/line.toml") == 777
    (repository / "paper-4ms").write_text(text, encoding="utf-8")
    assert profile("paper-4ms") == busplan.load_profile("paper-4ms")
    assert profile("profiles/line.toml").name == "line"


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("nope:profiles/line.toml", "fatal: invalid object name 'nope'."),
        ("HEAD~9:profiles/line.toml", "fatal: invalid object name 'HEAD~9'."),
        ("nope@{10:00}:profiles/line.toml", "fatal: invalid object name 'nope@{10:00}'."),
        ("a tree b:profiles/line.toml", "fatal: invalid object name 'a tree b'."),
        ("HEAD:profiles/other.toml", "fatal: path 'profiles/other.toml' does not exist in 'HEAD'"),
        ("HEAD:profiles/a tree b", "fatal: path 'profiles/a tree b' does not exist in 'HEAD'"),
        ("HEAD:profiles/line.toml/x", "fatal: path 'profiles/line.toml/x' does not exist in 'HEAD'"),
        ("HEAD:profiles", "bad file"),
        ("HEAD:.", "bad file"),
        ("-x:profiles/line.toml", "no such file, and no shipped profile of that name"),
        ("--output=x:profiles/line.toml", "no such file, and no shipped profile of that name"),
        (":profiles/line.toml", "no such file, and no shipped profile of that name"),
        ("HEAD:", "no such file, and no shipped profile of that name"),
        ("HEAD\n:profiles/line.toml", "no such file, and no shipped profile of that name"),
        ("HEAD:profiles/line.toml\0", "no such file, and no shipped profile of that name"),
        (f"HEAD:{'y' * 300}/z.toml", "cannot be read: File name too long"),
    ],
)
def test_what_cannot_be_read_is_said(
    repository: Path, monkeypatch: pytest.MonkeyPatch, argument: str, said: str
) -> None:
    monkeypatch.chdir(repository)
    message = refusal(argument)
    assert message.startswith(f"{argument}: ")
    assert said in message
    assert sorted(repository.glob("x")) == []


def test_faults_of_a_file_are_named_as_it_was_typed(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(repository)
    assert refusal("v1:./broken.toml").startswith("v1:./broken.toml:6:1: bus.nodes = 0: must be 1 or more")
    assert refusal("v1:large.toml").startswith("v1:large.toml:1:1: the file is over 2,000,000 bytes")


def test_without_a_repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert "git says: fatal: not a git repository" in refusal("HEAD:line.toml")


def test_an_empty_repository_has_no_revision(git: Git, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert git("status", "--short") == b""
    monkeypatch.chdir(tmp_path / "repository")
    assert "invalid object name 'HEAD'" in refusal("HEAD:line.toml")


@pytest.mark.parametrize(
    "variables",
    [
        {"GIT_DIR": "/nowhere"},
        {"GIT_INDEX_FILE": "/nowhere", "GIT_WORK_TREE": "/"},
        {"GIT_OBJECT_DIRECTORY": "/nowhere"},
        {"GIT_PREFIX": "gone/", "GIT_TRACE": "1", "GIT_PAGER": "false", "LC_ALL": "de_DE.UTF-8"},
    ],
)
def test_what_git_sets_for_its_hooks_leads_nowhere_else(
    repository: Path, monkeypatch: pytest.MonkeyPatch, variables: dict[str, str]
) -> None:
    monkeypatch.chdir(repository)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert period_us("v1:profiles/line.toml") == 4000
    assert "invalid object name 'nope'" in refusal("nope:profiles/line.toml")


def fake_git(folder: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    path = folder / "git"
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")


def test_without_git(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert refusal("HEAD:line.toml") == (
        "HEAD:line.toml: no such file; to read REV:path needs git, and there is no git on PATH"
    )
    assert profile("paper-4ms").name == "paper-4ms"


def test_a_git_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    fake_git(tmp_path, monkeypatch, "exec sleep 60")
    monkeypatch.setattr("busplan.profile.sources.TIMEOUT_S", 0.2)
    assert refusal("HEAD:line.toml") == "HEAD:line.toml: git gave no answer within 0.2 s"


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("echo 'fatal: dubious' >&2; echo '  call git' >&2; exit 128", "git says: fatal: dubious call git"),
        ("printf 'fatal: a\\033[2Jb' >&2; exit 128", "git says: fatal: a\\x1b[2Jb"),
        ("exit 1", "git says: nothing"),
        ('[ "$LC_ALL" = C ] || exit 1; echo "fatal: in C" >&2; exit 1', "git says: fatal: in C"),
        ("exit 0", "leads to no file of revision HEAD"),
        ("printf '\\377\\n'", "leads to no file of revision HEAD"),
    ],
)
def test_a_git_that_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, said: str) -> None:
    monkeypatch.chdir(tmp_path)
    fake_git(tmp_path, monkeypatch, script)
    message = refusal("HEAD:line.toml")
    assert message.startswith("HEAD:line.toml: ")
    assert said in message


def test_a_large_file_is_not_even_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    some = "0" * 40
    fake_git(tmp_path, monkeypatch, f'[ "$4" = blob ] && touch read; echo {some} blob 9000000000')
    assert refusal("HEAD:line.toml").startswith("HEAD:line.toml:1:1: the file is over 2,000,000 bytes")
    assert not (tmp_path / "read").exists()


def damaged(repository: Path, git: Git, name: str) -> Path:
    """Take the object of a file out of the repository."""
    identity = git("rev-parse", f"HEAD:{name}").decode().strip()
    path = repository / ".git" / "objects" / identity[:2] / identity[2:]
    path.chmod(0o644)
    path.unlink()
    return path


@pytest.mark.parametrize("name", ["profiles/line.toml", ""])
def test_what_git_cannot_read_is_refused(
    repository: Path, git: Git, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    damaged(repository, git, name)
    monkeypatch.chdir(repository)
    assert "git says: fatal: " in refusal("HEAD:profiles/line.toml")


def old_git(folder: Path) -> Path:
    """A folder for PATH with a git that does not know how to leave what is missing alone."""
    git = shutil.which("git")
    folder.mkdir()
    (folder / "git").write_text(f'#!/bin/sh\nunset GIT_NO_LAZY_FETCH\nexec {git} "$@"\n', encoding="utf-8")
    (folder / "git").chmod(0o755)
    return folder


@pytest.mark.parametrize("age", ["new", "old"])
@pytest.mark.parametrize("missing", ["profiles/line.toml", "profiles", ""])
def test_no_program_of_a_repository_is_run_to_fetch_what_is_missing(
    repository: Path, git: Git, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str, age: str
) -> None:
    damaged(repository, git, missing)
    mark = tmp_path / "run"
    git("config", "core.repositoryformatversion", "1")
    git("config", "extensions.partialClone", "origin")
    git("config", "remote.origin.promisor", "true")
    git("config", "protocol.ext.allow", "always")
    git("config", "core.sshCommand", f"touch {mark};")
    if age == "old":
        monkeypatch.setenv("PATH", f"{old_git(tmp_path / 'bin')}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(repository)
    for url in (f"ext::touch {mark}", "ssh://nowhere.invalid/x"):
        git("config", "remote.origin.url", url)
        said = refusal("HEAD:profiles/line.toml")
        assert re.search("lazy fetching disabled|transport '[a-z]+' not allowed", said)
        assert not mark.exists()


def test_a_name_of_two_things_is_refused(repository: Path, git: Git, monkeypatch: pytest.MonkeyPatch) -> None:
    git("branch", "two", "v1")
    git("tag", "two", "HEAD")
    monkeypatch.chdir(repository)
    assert "git says: warning: refname 'two' is ambiguous." in refusal("two:profiles/line.toml")
