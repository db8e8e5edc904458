"""Which profiles a list of paths means."""

import os
from pathlib import Path

import pytest

from busplan.profile.sources import Collection, collect, shipped_folder, shipped_names

CLAIM = "schema_version = 1\n"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return Path(os.path.realpath(tmp_path))


def write(*names: str, text: str = CLAIM) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")


def names(collection: Collection) -> list[str]:
    assert all(source.failure is None for source in collection.sources)
    return [source.name for source in collection.sources]


def failures(collection: Collection) -> list[str]:
    return [source.failure for source in collection.sources if source.failure is not None]


def test_a_folder_means_all_below_it_in_the_order_of_names() -> None:
    write("p/b.toml", "p/a.toml", "p/z/a.toml", "p/c/d/e.toml", "p/B.toml", "p/note.txt", "p/x.TOML.bak")
    assert names(collect(["p"])) == ["p/B.toml", "p/a.toml", "p/b.toml", "p/c/d/e.toml", "p/z/a.toml"]
    assert names(collect(["p/"])) == names(collect(["./p"])) == names(collect(["p"]))


def test_the_order_is_that_of_names_whatever_the_disk_says() -> None:
    expected = [f"p/{(number * 7919) % 997:03}/{(number * 31) % 7}.toml" for number in range(60)]
    write(*expected)
    assert names(collect(["p"])) == sorted(expected)


def test_hidden_and_foreign_folders_are_left_out_unless_named() -> None:
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
def test_what_claims_a_schema_version_is_checked(text: str) -> None:
    write("p/a.toml", text=text)
    assert names(collect(["p"])) == ["p/a.toml"]


@pytest.mark.parametrize(
    "text", ["", '[project]\nname = "schema_version"\n', "# schema_version = 1\n", "my_schema_version = 1", "a.schema"]
)
def test_what_claims_none_is_skipped_by_name(text: str) -> None:
    write("p/other.toml", text=text)
    write("p/a.toml")
    found = collect(["p"])
    assert (names(found), found.skipped) == (["p/a.toml"], ("p/other.toml",))


def test_a_file_that_is_named_is_checked_whatever_it_claims() -> None:
    write("pyproject.toml", "profile.txt", text="[project]\n")
    found = collect(["pyproject.toml", "profile.txt"])
    assert (names(found), found.skipped) == (["pyproject.toml", "profile.txt"], ())


def test_a_large_or_binary_file_is_judged_by_its_beginning() -> None:
    write("p/large.toml", text="schema_version = 1\n" + "# more\n" * 100_000)
    Path("p/binary.toml").write_bytes(b"\xff\xfe\x00schema_version\n")
    Path("p/latin1.toml").write_bytes(b"schema_version = 1\nname = '\xe9'\n")
    assert names(collect(["p"])) == ["p/large.toml", "p/latin1.toml"]


def test_shipped_names_mean_the_shipped_profiles_whatever_lies_here() -> None:
    Path("paper-1ms").mkdir()
    write("paper-1ms/a.toml", "paper-4ms")
    for name in shipped_names():
        (source,) = collect([name]).sources
        assert source == (shipped_folder() / f"{name}.toml", f"{name}.toml", None, True)
    assert names(collect(["./paper-1ms", "./paper-4ms"])) == ["paper-1ms/a.toml", "paper-4ms"]


def test_a_shipped_profile_and_a_file_called_alike_are_two(here: Path) -> None:
    write("paper-4ms.toml")
    assert names(collect(["paper-4ms", "paper-4ms.toml"])) == ["paper-4ms.toml", str(here / "paper-4ms.toml")]


def test_each_file_is_checked_once_under_one_name(here: Path) -> None:
    write("p/a.toml", "p/q/b.toml")
    given = ["p/a.toml", "./p/a.toml", str(here / "p" / "a.toml"), "p/q/../a.toml", "p//a.toml", "p", str(here), "."]
    assert names(collect(given)) == ["p/a.toml", "p/q/b.toml"]
    assert names(collect(given[::-1])) == ["p/a.toml", "p/q/b.toml"]
    for one in given[:5]:
        assert names(collect([one])) == ["p/a.toml"]


def test_what_lies_elsewhere_keeps_its_name(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write("p/a.toml", "q/b.toml")
    monkeypatch.chdir("q")
    assert names(collect(["../p", "..", str(here / "p")])) == ["../p/a.toml", "b.toml"]
    assert names(collect([str(here / "p")])) == [str(here / "p/a.toml")]
    assert names(collect(["../q/b.toml", "../q", "."])) == ["b.toml"]


def test_standard_input_is_one_source_with_its_name() -> None:
    write("a.toml")
    assert names(collect(["-", "a.toml", "-"])) == ["<stdin>", "a.toml"]
    assert names(collect(["-"], stdin_name="editor.toml")) == ["editor.toml"]


def test_links_are_followed_to_files_and_not_to_folders() -> None:
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


def test_pipes_and_folders_called_like_profiles_are_skipped() -> None:
    write("p/a.toml", "p/folder.toml/b.toml")
    os.mkfifo("p/pipe.toml")
    found = collect(["p"])
    assert (names(found), found.skipped) == (["p/a.toml", "p/folder.toml/b.toml"], ("p/pipe.toml",))


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("gone.toml", "gone.toml: no such file"),
        ("", "'': no such file"),
        ("a\0b", "no such file"),
        ("x" * 5000, "no such file"),
        ("empty", "empty: no profile below this folder"),
        ("paper-5ms", "shipped are can-fd-arm-7, can-servo-8, canopen-6, dvrk, "),
    ],
)
def test_what_means_nothing_is_a_failure_in_its_place(argument: str, words: str) -> None:
    write("a.toml", "b.toml")
    write("empty/other.toml", text="")
    found = collect(["a.toml", argument, "b.toml"])
    assert [source.name for source in found.sources] == ["a.toml", argument, "b.toml"]
    assert [source.failure is None for source in found.sources] == [True, False, True]
    assert words in failures(found)[0]


def test_a_folder_that_cannot_be_looked_into_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    write("p/a.toml", "p/secret/b.toml")
    scandir = os.scandir

    def refuse(path: str) -> object:
        if Path(path).name == "secret":
            raise PermissionError(13, "Permission denied", path)
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    found = collect(["p"])
    assert [source.name for source in found.sources] == ["p/a.toml", "p/secret"]
    assert failures(found) == ["p/secret: cannot be read: Permission denied"]


def test_a_name_that_is_no_utf_8_is_kept() -> None:
    Path("p").mkdir()
    with open(b"p/\xff.toml", "wb") as file:  # noqa: PTH123 - a path of bytes
        file.write(CLAIM.encode())
    assert names(collect(["p"])) == ["p/\udcff.toml"]
