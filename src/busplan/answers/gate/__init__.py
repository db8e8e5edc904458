"""The gate's report in each of its formats."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Final, Literal

from busplan.rules.report import CheckReport

GateFormat = Literal["text", "full", "json", "github", "gitlab", "junit", "sarif"]

_MODULES: Final[Mapping[GateFormat, str]] = {
    "text": "plain",
    "full": "plain",
    "json": "documents",
    "github": "plain",
    "gitlab": "documents",
    "junit": "junit",
    "sarif": "sarif",
}


def render(report: CheckReport, *, file_format: GateFormat) -> str:
    """Write a report in one of the formats.

    Parameters
    ----------
    report
        What was found.
    file_format
        Which format; only its own module is loaded.
    """
    module = import_module(f"busplan.answers.gate.{_MODULES[file_format]}")
    writer: Callable[[CheckReport], str] = getattr(module, f"as_{file_format}")
    return writer(report)
