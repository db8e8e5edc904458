"""Every command's --help reads well alone: whatever is added to the tree of commands has to pass."""

import os
import re
import shlex
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any
from unittest import mock

import pytest
from typer.main import get_command

from busplan.buses.hosts import hosts
from busplan.cli import app
from busplan.cli.lazy import FAILURES
from tests.registers import COMMANDS

Run = Callable[..., CompletedProcess[str]]

ROOT: Any = get_command(app)
TOP: Any = ROOT.context_class(ROOT, info_name="busplan", **ROOT.context_settings)
UNIT = re.compile(r"\[(us|ms|s|mm|um|mm/min|mm/s|bytes|kbit/s|axes|nodes|deg|dB|%|1)\]|with its unit")
OF_MACHINES = tuple(Path(__file__).parents[1] / "questions" / name / "files" for name in ("import_", "measured"))
"""Folders with files of a machine."""
PROFILES = Path(__file__).parents[2] / "profiles"
GATE = re.compile(r"[Ee]xits 0 [^.]*\b1\b")


def context(name: str) -> Any:
    """What a command's help is made in; that of the program itself by an empty name."""
    if not name:
        return TOP
    command = ROOT.get_command(TOP, name)
    return command.context_class(command, info_name=name, parent=TOP, **command.context_settings)


def shown(name: str, *, columns: int) -> list[str]:
    """Lines of the help on a terminal."""
    with mock.patch.dict(os.environ, {"COLUMNS": str(columns)}):
        lines: list[str] = context(name).get_help().splitlines()
    return lines


def paragraphs(name: str) -> list[str]:
    return [" ".join(text.split()) for text in context(name).command.help.split("\n\n")]


def examples(name: str) -> list[str]:
    marked = (text for text in paragraphs(name) if text.startswith("Example: "))
    return [text.removeprefix("Example: ") for text in marked]


def parameters(name: str) -> Iterator[tuple[Any, str]]:
    """Every argument and option of a command, with its help as typer writes it."""
    here = context(name)
    for param in here.command.get_params(here):
        yield param, param.get_help_record(here)[1]


EVERY_COMMAND = pytest.mark.parametrize("name", ["", *COMMANDS])


@EVERY_COMMAND
def test_it_begins_with_one_sentence_has_an_example_to_copy_and_ends_with_its_exit_codes(name: str) -> None:
    lines = shown(name, columns=80)
    assert re.fullmatch(r"[A-Z][^.?!]*[.?]", paragraphs(name)[0])
    assert examples(name)
    for example in examples(name):
        assert f"  Example: {example}" in lines
        assert example.startswith(f"busplan {name}".strip())
    said = " ".join(" ".join(lines).split())
    if name:
        assert re.search(r"\b[Ee]xits 0\b", said)
        assert said.endswith(FAILURES)
    else:
        assert said.endswith(
            "Exit codes: 0 done, 1 the answer is no (findings, no plan, a circle that fails), 2 could not do the job, "
            "130 interrupted, 143 terminated, 129 hung up."
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "example"), [pytest.param(name, one, id=one) for name in ("", *COMMANDS) for one in examples(name)]
)
def test_its_example_runs_as_it_stands(shell: Run, name: str, example: str, tmp_path: Path) -> None:
    words = shlex.split(example)
    for before, word in pairwise(words):
        # A profile that a user must have; what follows -o is written.
        if word.endswith(".toml") and before not in {"-o", "--output", ">"}:
            (tmp_path / word).write_bytes((PROFILES / "paper-4ms.toml").read_bytes())
        for folder in OF_MACHINES:
            if (folder / word).is_file():
                (tmp_path / word).write_bytes((folder / word).read_bytes())
    run = shell(example, cwd=tmp_path)
    is_gate = GATE.search(" ".join(paragraphs(name))) is not None
    assert run.returncode in ({0, 1} if is_gate else {0}), run.stderr
    # A gate with nothing to find says so beside the document.
    assert run.stdout or list(tmp_path.iterdir()) or (is_gate and run.stderr)


@EVERY_COMMAND
def test_no_line_is_wider_than_the_terminal(name: str) -> None:
    usual = len(shown(name, columns=80))
    for columns in (60, 80, 100, 200):
        lines = shown(name, columns=columns)
        assert max(map(len, lines)) <= min(columns, 100)
        # Not a column of words one below the other either: meanings keep room.
        assert len(lines) < 2 * usual


def test_commands_stand_in_groups_with_their_sentences_whole_and_init_comes_first() -> None:
    lines = shown("", columns=80)
    titles = [lines.index(f"{title}:") for title in ("Design", "Analyse", "Gate", "Learn", "Options")]
    assert titles == sorted(titles)
    assert lines[titles[0] + 1].startswith("  init ")
    said = " ".join(" ".join(lines).split())
    for name in COMMANDS:
        assert f"{name} {paragraphs(name)[0]}" in said


@EVERY_COMMAND
def test_it_speaks_of_no_types_of_python(name: str) -> None:
    text = "\n".join(shown(name, columns=100))
    assert not re.search(r"<(str|int|float|bool|path|list\[|.* range)|[{}]", text)
    usage = text.partition("\n\n")[0]
    here = context(name)
    for param in here.command.params:
        if param.param_type_name == "argument":
            assert param.metavar in usage
            assert param.metavar == param.metavar.upper()


@EVERY_COMMAND
def test_every_parameter_says_what_it_is_its_unit_its_default_and_what_may_stand_there(name: str) -> None:
    for param, said in parameters(name):
        assert re.fullmatch(r"[A-Za-z][^\n]*\.(  \[[^\n]+\])*", said), said
        kind, meant = param.type_descriptor.annotation, f"{param.metavar} {said}"
        if kind is float or (kind is int and param.metavar != "N") or "TIME" in meant:
            assert UNIT.search(said), said
        assert "BYTES" not in meant or "bytes" in said, said
        is_option = param.param_type_name == "option"
        is_switch = is_option and param.is_flag and not param.secondary_opts
        assert is_switch or re.search(r"[\[ ]default: [^\]]|[\[ ]required\]", said), said
        if is_option and not param.is_flag:
            assert param.metavar or param.type_descriptor.is_choice, said


@EVERY_COMMAND
def test_a_default_is_said_once(name: str) -> None:
    for param, words in parameters(name):
        assert words.count("[default") <= 1, param.name


@EVERY_COMMAND
def test_the_shell_offers_each_option_with_help_on_one_line(run: Run, name: str) -> None:
    here = context(name)
    params = [param for param in here.command.get_params(here) if param.param_type_name == "option"]
    flags = [one for param in params for one in param.opts + param.secondary_opts if one.startswith("--")]
    for shell in ("fish", "zsh"):
        asked = {
            "_BUSPLAN_COMPLETE": f"complete_{shell}",
            "_TYPER_COMPLETE_ARGS": f"busplan {name} --".replace("  ", " "),
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        }
        offers = run(inside={"variables": asked}).stdout.splitlines()
        assert len(offers) == len(flags)
        if shell == "fish":
            assert sorted(offer.partition("\t")[0] for offer in offers) == sorted(flags)


def test_init_names_all_hosts_with_their_meanings() -> None:
    here = context("init")
    (host,) = (param for param in here.command.get_params(here) if param.name == "host")
    assert ", ".join(f"{name} ({one.meaning})" for name, one in hosts().items()) in host.help
