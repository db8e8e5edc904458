"""An answer higher than the terminal opens in the user's pager, and no page of HTML goes to a terminal."""

from collections.abc import Callable
from pathlib import Path

import pytest

OnTerminal = Callable[..., tuple[int, str]]
LOW, HIGH = {"LINES": "24", "COLUMNS": "80"}, {"LINES": "300", "COLUMNS": "80"}
PAGER = {"PAGER": "sed s/^/PAGED:/"}


def shown(on_terminal: OnTerminal, *arguments: str, cwd: Path, env: dict[str, str], keyboard: bool = True) -> str:
    code, text = on_terminal(*arguments, cwd=cwd, env=env, process=True, keyboard=keyboard)
    assert code == 0, text
    return text


@pytest.mark.slow
@pytest.mark.parametrize("command", ["compare", "map", "latency --all", "explain"])
def test_a_high_answer_opens_in_the_pager(on_terminal: OnTerminal, tmp_path: Path, command: str) -> None:
    lines = shown(on_terminal, *command.split(), "paper-4ms", cwd=tmp_path, env={**LOW, **PAGER}).splitlines()
    assert len(lines) >= 24
    assert all(line.startswith("PAGED:") for line in lines)


@pytest.mark.slow
def test_no_pager_opens_where_none_is_due(on_terminal: OnTerminal, tmp_path: Path) -> None:
    cases: list[tuple[tuple[str, ...], dict[str, str], bool]] = [
        (("--no-pager", "map", "paper-4ms"), {**LOW, **PAGER}, True),
        (("map", "paper-4ms", "--no-pager"), {**LOW, **PAGER}, True),
        (("map", "paper-4ms"), {**HIGH, **PAGER}, True),
        (("map", "paper-4ms"), {**LOW, "PAGER": "cat"}, True),
        (("map", "paper-4ms"), {**LOW, **PAGER}, False),
        (("capacity", "paper-4ms"), {**LOW, **PAGER}, True),
    ]
    for arguments, env, keyboard in cases:
        text = shown(on_terminal, *arguments, cwd=tmp_path, env=env, keyboard=keyboard)
        assert "paper-4ms" in text
        assert "PAGED:" not in text


@pytest.mark.parametrize("arguments", [("report", "paper-4ms"), ("capacity", "paper-4ms", "--format", "html")])
def test_no_page_goes_to_a_terminal(on_terminal: OnTerminal, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    assert on_terminal(*arguments, cwd=tmp_path) == (
        2,
        "--format html: is not for a terminal; give -o FILE.html, or use a pipe\n",
    )
