"""A file may be called anything: in no form does its name command a terminal, and JSON reads back to that very name."""

import csv
import json
import re
from collections.abc import Callable, Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

# A colour, DEL, a C1 control, marks of direction, a line and a paragraph separator, a byte order mark, no UTF-8.
EVIL = "a\x1b[31m\x7f\x9b2J\u202e\u2066\u2028\u2029\ufeff\udcff"
PROFILE, OTHER, FAULTY, FAILING, MEASURED = (
    f"{EVIL}.toml",
    f"other-{EVIL}.toml",
    f"faulty-{EVIL}.toml",
    f"failing-{EVIL}.toml",
    f"{EVIL}.csv",
)
SHIPPED = Path(__file__).parents[2] / "profiles"
GATE_FORMATS = ("concise", "full", "json", "github", "gitlab", "junit", "sarif")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    text = (SHIPPED / "paper-1ms.toml").read_text(encoding="utf-8")
    for name, content in (
        (PROFILE, text),
        (OTHER, text.replace("nodes = 2", "nodes = 3")),
        (FAULTY, f'{text}\n[nonsense]\n["\\u202e"]\n'),
        (FAILING, f"{text.replace('nodes = 2', 'nodes = 9')}\n# busplan: ignore[\u202e\u2028] \u202e\u2066\n"),
        (MEASURED, (SHIPPED / "table-1.csv").read_text(encoding="utf-8")),
    ):
        (folder / name).write_text(content, encoding="utf-8")
    return folder


def calls() -> Iterator[tuple[str, ...]]:
    """Every way in which a name is written: by each form, by each command, by each message."""
    for form in ("table", "markdown", "html", "csv", "json"):
        yield ("diff", PROFILE, OTHER, "--format", form)
        yield ("calibrate", PROFILE, MEASURED, "--format", form)
    for command in ("capacity", "latency", "timeline", "map", "compare", "plan", "explain", "report"):
        yield (command, PROFILE)
        yield (command, FAULTY, "--format", "json")
    yield from ((command, PROFILE, "--format", "svg") for command in ("timeline", "map", "compare"))
    yield from (("sweep", PROFILE, "--vary", "bus.nodes=1:3", "--format", form) for form in ("table", "csv", "json"))
    yield ("report", PROFILE, OTHER, "--circle", "--format", "markdown")
    for form in GATE_FORMATS:
        yield ("check", ".", f"no-{EVIL}", "--verbose", "--no-circle", "--format", form)
        yield ("check", "-", "--stdin-filename", EVIL, "--verbose", "--format", form)
    yield ("check", ".", "--no-circle", "--baseline", f"base-{EVIL}.json", "--update-baseline")
    yield ("check", ".", "--no-circle", "--baseline", PROFILE)
    yield from ((command, PROFILE, "-o", f"new-{EVIL}.txt") for command in ("timeline", "plan"))
    yield ("plan", PROFILE, "-o", f"new-{EVIL}.toml")
    yield from (("sweep", PROFILE, "--vary", f"{EVIL}=1"), ("map", PROFILE, "--x", f"{EVIL}=1"))
    yield from (("compare", PROFILE, "--buses", EVIL), ("explain", PROFILE, EVIL))
    yield from ((EVIL,), (f"--{EVIL}",), ("capacity", PROFILE, f"--{EVIL}"), ("schema", EVIL), ("rule", EVIL))
    yield from (("capacity", PROFILE, option, EVIL) for option in ("--format", "--period", "--timing-model"))


def _shown(arguments: tuple[str, ...]) -> str:
    return ascii(" ".join(arguments)).replace(ascii(EVIL).strip("'"), "EVIL")


@pytest.mark.slow
@pytest.mark.parametrize("arguments", list(calls()), ids=_shown)
def test_no_name_commands_a_terminal(arguments: tuple[str, ...], run: Run, folder: Path) -> None:
    before = set(folder.iterdir())
    done = run(*arguments, cwd=folder)
    new = [path for path in folder.iterdir() if path not in before]
    assert "busplan itself failed" not in done.stderr
    for text in (done.stdout, done.stderr, *(path.read_text(encoding="utf-8") for path in new)):
        # The separators of a document are line ends and tabs.
        assert [line for line in re.split("[\n\t]", text) if not line.isprintable()] == []
    for path in new:
        path.unlink()


def test_json_reads_back_to_the_name(run: Run, folder: Path) -> None:
    checked = json.loads(run("check", PROFILE, "--no-circle", "--format", "json", cwd=folder).stdout)
    assert [one["path"] for one in checked["files"]] == [PROFILE]
    compared = json.loads(run("diff", PROFILE, OTHER, "--format", "json", cwd=folder).stdout)
    assert (compared["a"]["argument"], compared["b"]["argument"]) == (PROFILE, OTHER)


def test_a_baseline_knows_the_name_again(run: Run, folder: Path) -> None:
    given = ("check", PROFILE, "--no-circle", "--baseline", "base.json")
    run(*given, "--update-baseline", cwd=folder)
    written = (folder / "base.json").read_text(encoding="utf-8")
    assert list(json.loads(written)["profiles"]) == [PROFILE]
    assert "\\u009b" in written
    (folder / PROFILE).write_bytes((folder / OTHER).read_bytes())
    assert "BP301" in run(*given, cwd=folder).stdout
    (folder / PROFILE).write_bytes((SHIPPED / "paper-1ms.toml").read_bytes())


@pytest.mark.parametrize("beginning", ["=cmd|' /C calc'!A0", "+1", "-1", "@SUM(A1)"])
@pytest.mark.parametrize("command", [("capacity",), ("plan",)], ids=" ".join)
def test_no_name_is_a_formula_of_a_spreadsheet(
    command: tuple[str, ...], beginning: str, run: Run, tmp_path: Path
) -> None:
    text = (SHIPPED / "paper-4ms.toml").read_text(encoding="utf-8")
    (tmp_path / "p.toml").write_text(text.replace('name = "paper-4ms"', f'name = "{beginning}"'), encoding="utf-8")
    name, *options = command
    rows = list(csv.DictReader(StringIO(run(name, "p.toml", *options, "--format", "csv", cwd=tmp_path).stdout)))
    assert {row["profile"] for row in rows} == {f"'{beginning}"}
    cells = [cell for row in rows for key, cell in row.items() if key != "profile"]
    assert not any(cell.startswith("'") for cell in cells)
    for cell in cells:
        if cell.startswith(("=", "+", "-", "@")):
            float(cell)
