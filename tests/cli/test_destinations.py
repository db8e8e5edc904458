"""No output over an input or another output, and no report into a profile."""

from collections.abc import Callable
from pathlib import Path

import pytest

Refused = Callable[..., str]

PROFILE = Path(__file__).parents[2] / "profiles" / "paper-1ms.toml"
VARY = ("--vary", "bus.nodes=1:3")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A profile p.toml, more called x.csv, with a link and a hard link to it, and y.csv, and a link to nowhere."""
    for name in ("p.toml", "x.csv", "y.csv"):
        (tmp_path / name).write_bytes(PROFILE.read_bytes())
    (tmp_path / "link.csv").symlink_to("x.csv")
    (tmp_path / "twin.csv").hardlink_to(tmp_path / "x.csv")
    (tmp_path / "p.csv").symlink_to("p.toml")
    (tmp_path / "lost.svg").symlink_to("new.svg")
    (tmp_path / "b.json").write_text("{}", encoding="utf-8")
    return tmp_path


def contents(folder: Path) -> dict[str, bytes | None]:
    return {path.name: path.read_bytes() if path.exists() else None for path in folder.iterdir()}


OVER_AN_INPUT = {
    "--output x.csv": ("check", "x.csv", "-o", "x.csv"),
    "--output ./p.toml": ("check", ".", "-o", "./p.toml"),
    "--output link.csv": ("check", "x.csv", "-o", "link.csv"),
    "--output twin.csv": ("sweep", "x.csv", *VARY, "-o", "twin.csv"),
    "--output p.csv": ("sweep", "p.toml", *VARY, "-o", "p.csv"),
    "--trace x.csv": ("circle-test", "x.csv", "--trace", "x.csv"),
    "--trace p.csv": ("circle-test", "p.toml", "--trace", "p.csv"),
    "--output x.csv ": ("report", "paper-4ms", "x.csv", "-o", "x.csv", "--format", "html"),
    "--output x.csv  ": ("timeline", "x.csv", "-o", "x.csv"),
    "--output b.json": ("check", "p.toml", "--baseline", "b.json", "-o", "b.json"),
    "--output link.csv ": ("diff", "paper-1ms", "x.csv", "-o", "link.csv"),
    "--output link.csv  ": ("compare", "x.csv", "-o", "link.csv"),
    "--output link.csv   ": ("explain", "x.csv", "required_us", "-o", "link.csv"),
    "--output y.csv ": ("calibrate", "x.csv", "y.csv", "-o", "y.csv"),
    "--baseline y.csv": ("check", "y.csv", "--baseline", "y.csv", "--update-baseline"),
}
INTO_A_PROFILE = {
    "--output new.toml": ("check", "x.csv", "-o", "new.toml"),
    "--output new.TOML": ("sweep", "x.csv", *VARY, "--format", "csv", "-o", "new.TOML"),
    "--output p.csv": ("timeline", "x.csv", "-o", "p.csv"),
    "--trace new.toml": ("circle-test", "x.csv", "--trace", "new.toml"),
    "--output new.toml ": ("report", "x.csv", "-o", "new.toml", "--format", "html"),
    "--output new.toml  ": ("manual", "profile", "-o", "new.toml"),
    "--baseline new.toml": ("check", "x.csv", "--baseline", "new.toml", "--update-baseline"),
}
TWICE = {
    "--output new.svg and --trace lost.svg": ("circle-test", "x.csv", "-o", "new.svg", "--trace", "lost.svg"),
    "--output a.svg and --trace A.svg": ("circle-test", "x.csv", "-o", "a.svg", "--trace", "A.svg"),
    "--output ./a.svg and --trace a.svg": ("circle-test", "x.csv", "--trace", "a.svg", "-o", "./a.svg"),
    "--output b.json and --baseline b.json": (
        "check", "x.csv", "--baseline", "b.json", "--update-baseline", "-o", "b.json",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("said", "arguments"),
    [
        *((f"{words.strip()}: would overwrite ", given) for words, given in OVER_AN_INPUT.items()),
        *((f"{words.strip()}: .toml is a profile's name", given) for words, given in INTO_A_PROFILE.items()),
        *((f"{words.replace('./', '')}: the same file; give two names", given) for words, given in TWICE.items()),
        ("x.csv: has 2 hard links", ("check", "x.csv", "--baseline", "x.csv", "--update-baseline")),
        ("--trace -: standard output has the document", ("circle-test", "x.csv", "--trace", "-")),
    ],
)
def test_nothing_is_destroyed(refused: Refused, folder: Path, said: str, arguments: tuple[str, ...]) -> None:
    before = contents(folder)
    assert refused(*arguments, cwd=folder).startswith(said.replace("--output ./p", "--output p"))
    assert contents(folder) == before


def test_what_is_the_purpose_is_done(run: Callable[..., object], folder: Path) -> None:
    before = contents(folder)
    update = ("check", "x.csv", "--no-circle", "--baseline", "b.json", "--update-baseline", "-q")
    (folder / "b.json").unlink()
    for arguments in (
        update,
        update,
        ("plan", "p.toml", "--nodes", "3", "--apply"),
        ("plan", "p.toml", "-o", "new.toml"),
        ("circle-test", "paper-4ms", "-o", "a.svg", "--trace", "b.csv", "--every", "1000"),
    ):
        assert getattr(run(*arguments, cwd=folder), "returncode", None) == 0
    after = contents(folder)
    assert {name for name in after if before.get(name) != after[name]} >= {"b.json", "new.toml", "a.svg", "b.csv"}
    assert after["x.csv"] == before["x.csv"]
