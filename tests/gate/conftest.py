"""A profile that has no findings, ways to make one that has, and the check of a text."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

import busplan

EXAMPLES = Path(__file__).parent / "examples"
CLEAN = (EXAMPLES / "BP001" / "valid.toml").read_text(encoding="utf-8")
MODELS = json.loads((EXAMPLES / "BP301" / "baseline.json").read_text(encoding="utf-8"))["models"]

Changed = Callable[..., str]
Check = Callable[..., Any]


@pytest.fixture
def clean() -> str:
    return CLEAN


@pytest.fixture
def changed() -> Changed:
    """The clean profile with some texts replaced, each of which must be there once."""

    def change(*pairs: tuple[str, str], more: str = "") -> str:
        text = CLEAN
        for old, new in pairs:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        return text + more

    return change


@pytest.fixture
def gate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Check:
    """Check a text, or bytes, as a file: the whole answer.

    `baseline` has `figures` and `keys` as a file of the answer has them; without keys, it is an older one.
    """
    monkeypatch.chdir(tmp_path)

    def check(
        text: str | bytes, *, name: str = "a.toml", baseline: Mapping[str, Any] | None = None, **options: Any
    ) -> Any:
        Path(name).write_bytes(text.encode() if isinstance(text, str) else text)
        if baseline is not None:
            keys = {name: baseline["keys"]} if baseline.get("keys") is not None else {}
            content = {"schema": 1, "command": "baseline", "models": MODELS, "keys": keys}
            recorded = json.dumps({**content, "profiles": {name: baseline["figures"]}})
            Path("baseline.json").write_text(recorded, encoding="utf-8")
            options["baseline"] = "baseline.json"
        return busplan.check(name, record=True, **options)

    return check


@pytest.fixture
def check(gate: Check) -> Check:
    """Check a text: the result of its file."""
    return lambda text, **options: gate(text, **options).files[0]
