"""A profile that has no findings, and ways to make one that has."""

from collections.abc import Callable
from pathlib import Path

import pytest

from busplan.gate.gate import FileResult, check_document
from busplan.profile.document import Document

CLEAN = (Path(__file__).parent / "examples" / "BP001" / "valid.toml").read_text(encoding="utf-8")

Changed = Callable[..., str]
Check = Callable[..., FileResult]


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
def check() -> Check:
    def check(text: str, **options: object) -> FileResult:
        return check_document(Document("a.toml", text), **options)  # type: ignore[arg-type]

    return check
