"""Which profiles a list of paths means."""

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

CLAIM = "schema_version = 1\n"
SHIPPED = [path.stem for path in (Path(__file__).resolve().parents[2] / "profiles").glob("*.toml")]


class Collection(NamedTuple):
    """Files as `check` names them, each with why it cannot be checked, and what is skipped."""

    files: list[tuple[str, str | None]]
    skipped: tuple[str, ...]


Collect = Callable[..., Collection]


@pytest.fixture
def collect(run: Callable[..., Any]) -> Collect:
    def call(paths: Sequence[str], *options: str) -> Collection:
        words = ("check", "--no-circle", "--verbose", "--format", "json", *options, "--", *paths)
        done = run(*words, cwd=Path.cwd(), stdin=CLAIM)
        skipped = (line.rpartition(": skipped, ")[0] for line in done.stderr.splitlines())
        files = [(file["path"], file.get("failure")) for file in json.loads(done.stdout)["files"]]
        return Collection(files, tuple(filter(None, skipped)))

    return call


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path(os.path.realpath(tmp_path))


def write(*names: str, text: str = CLAIM) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")


def names(collection: Collection) -> list[str]:
    assert all(failure is None for _, failure in collection.files)
    return [name for name, _ in collection.files]


def test_a_folder_means_all_below_it_in_the_order_of_names(collect: Collect) -> None:
    write("p/b.toml", "p/a.toml", "p/z/a.toml", "p/c/d/e.toml", "p/B.toml", "p/note.txt", "p/x.TOML.bak")
    assert names(collect(["p"])) == ["p/B.toml", "p/a.toml", "p/b.toml", "p/c/d/e.toml", "p/z/a.toml"]
    assert names(collect(["p/"])) == names(collect(["./p"])) == names(collect(["p"]))


def test_the_order_is_that_of_names_whatever_the_disk_says(collect: Collect) -> None:
    expected = [f"p/{(number * 7919) % 997:03}/{(number * 31) % 7}.toml" for number in range(60)]
    write(*expected)
    assert names(collect(["p"])) == sorted(expected)


def test_hidden_and_foreign_folders_are_left_out_unless_named(collect: Collect) -> None:
    write("p/a.toml", "p/.venv/b.toml", "p/node_modules/c.toml", "p/__pycache__/d.toml", "p/.e.toml")
    assert names(collect(["p"])) == ["p/.e.toml", "p/a.toml"]
    assert names(collect(["p/.venv", "p/node_modules"])) == ["p/.venv/b.toml", "p/node_modules/c.toml"]


@pytest.mark.parametrize(
    "text",
    [
        "schema_version = 1\n",
        "\ufeffschema_version = 1\n",
        "# first\n  schema_version=2",
        '"schema_version" = 1',
        "'schema_version' = 1",
        'name = "a"\r\nschema_version = 1\r\n',
        '[bus]\nschema_version = "behind a table, which is a slip"',
    ],
)
def test_what_claims_a_schema_version_is_checked(text: str, collect: Collect) -> None:
    write("p/a.toml", text=text)
    assert names(collect(["p"])) == ["p/a.toml"]


@pytest.mark.parametrize(
    "text", ["", '[project]\nname = "schema_version"\n', "# schema_version = 1\n", "my_schema_version = 1", "a.schema"]
)
def test_what_claims_none_is_skipped_by_name(text: str, collect: Collect) -> None:
    write("p/other.toml", text=text)
    write("p/a.toml")
    found = collect(["p"])
    assert (names(found), found.skipped) == (["p/a.toml"], ("p/other.toml",))


def test_a_file_that_is_named_is_checked_whatever_it_claims(collect: Collect) -> None:
    write("pyproject.toml", "profile.txt", text="[project]\n")
    found = collect(["pyproject.toml", "profile.txt"])
    assert (names(found), found.skipped) == (["pyproject.toml", "profile.txt"], ())


def test_a_large_or_binary_file_is_judged_by_its_beginning(collect: Collect) -> None:
    write("p/large.toml", text="schema_version = 1\n" + "# more\n" * 100_000)
    Path("p/binary.toml").write_bytes(b"\xff\xfe\x00schema_version\n")
    Path("p/latin1.toml").write_bytes(b"schema_version = 1\nname = '\xe9'\n")
    assert names(collect(["p"])) == ["p/large.toml", "p/latin1.toml"]


def test_shipped_names_mean_the_shipped_profiles_whatever_lies_here(collect: Collect) -> None:
    Path("paper-1ms").mkdir()
    write("paper-1ms/a.toml", "paper-4ms")
    assert names(collect(SHIPPED)) == [f"{name}.toml" for name in SHIPPED]
    assert names(collect(["./paper-1ms", "./paper-4ms"])) == ["paper-1ms/a.toml", "paper-4ms"]


def test_a_shipped_profile_and_a_file_called_alike_are_two(here: Path, collect: Collect) -> None:
    write("paper-4ms.toml")
    assert names(collect(["paper-4ms", "paper-4ms.toml"])) == ["paper-4ms.toml", str(here / "paper-4ms.toml")]


def test_each_file_is_checked_once_under_one_name(here: Path, collect: Collect) -> None:
    write("p/a.toml", "p/q/b.toml")
    given = ["p/a.toml", "./p/a.toml", str(here / "p" / "a.toml"), "p/q/../a.toml", "p//a.toml", "p", str(here), "."]
    assert names(collect(given)) == ["p/a.toml", "p/q/b.toml"]
    assert names(collect(given[::-1])) == ["p/a.toml", "p/q/b.toml"]
    for one in given[:5]:
        assert names(collect([one])) == ["p/a.toml"]


def test_what_lies_elsewhere_keeps_its_name(here: Path, monkeypatch: pytest.MonkeyPatch, collect: Collect) -> None:
    write("p/a.toml", "q/b.toml")
    monkeypatch.chdir("q")
    assert names(collect(["../p", "..", str(here / "p")])) == ["../p/a.toml", "b.toml"]
    assert names(collect([str(here / "p")])) == [str(here / "p/a.toml")]
    assert names(collect(["../q/b.toml", "../q", "."])) == ["b.toml"]


def test_standard_input_is_one_source_with_its_name(collect: Collect) -> None:
    write("a.toml")
    assert names(collect(["-", "a.toml", "-"])) == ["<stdin>", "a.toml"]
    assert names(collect(["-"], "--stdin-filename", "editor.toml")) == ["editor.toml"]


def test_links_are_followed_to_files_and_not_to_folders(collect: Collect) -> None:
    write("p/a.toml", "elsewhere/b.toml")
    Path("p/loop").symlink_to("..")
    Path("p/self.toml").symlink_to("self.toml")
    Path("p/gone.toml").symlink_to("nowhere.toml")
    Path("p/other").symlink_to("../elsewhere")
    Path("p/link.toml").symlink_to("../elsewhere/b.toml")
    found = collect(["p"])
    assert names(found) == ["p/a.toml", "p/link.toml"]
    assert found.skipped == ("p/gone.toml", "p/self.toml")
    assert names(collect(["p/other"])) == ["p/other/b.toml"]


def test_pipes_and_folders_called_like_profiles_are_skipped(collect: Collect) -> None:
    write("p/a.toml", "p/folder.toml/b.toml")
    os.mkfifo("p/pipe.toml")
    found = collect(["p"])
    assert (names(found), found.skipped) == (["p/a.toml", "p/folder.toml/b.toml"], ("p/pipe.toml",))


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("gone.toml", "gone.toml: no such file"),
        ("", "'': the path is empty"),
        ("a\0b", "no such file"),
        ("x" * 5000, "no such file"),
        ("empty", "empty: no profile below this folder"),
        ("paper-5ms", "shipped are can-fd-arm-7, can-fd-motors-8, can-motors-8, "),
    ],
)
def test_what_means_nothing_is_a_failure_in_its_place(argument: str, words: str, collect: Collect) -> None:
    write("a.toml", "b.toml")
    write("empty/other.toml", text="")
    found = collect(["a.toml", argument, "b.toml"])
    assert [name for name, _ in found.files] == ["a.toml", argument, "b.toml"]
    before, failure, behind = (failure for _, failure in found.files)
    assert (before, behind) == (None, None)
    assert words in str(failure)


def test_a_folder_that_cannot_be_looked_into_is_a_failure(monkeypatch: pytest.MonkeyPatch, collect: Collect) -> None:
    write("p/a.toml", "p/secret/b.toml")
    scandir = os.scandir

    def refuse(path: str) -> object:
        if Path(path).name == "secret":
            raise PermissionError(13, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    assert collect(["p"]).files == [("p/a.toml", None), ("p/secret", "p/secret: cannot be read: Permission denied")]


def test_a_name_that_is_no_utf_8_is_kept(collect: Collect) -> None:
    Path("p").mkdir()
    with open(b"p/\xff.toml", "wb") as file:  # noqa: PTH123 - a path of bytes
        file.write(CLAIM.encode())
    assert names(collect(["p"])) == ["p/\udcff.toml"]
