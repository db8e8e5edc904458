"""`busplan rule`."""

from typing import Annotated, Literal

import typer

from busplan.cli.output import emit_document, emit_text
from busplan.errors import BusplanError


def complete_code(incomplete: str) -> list[str]:
    """Codes of rules that begin as typed, for the shell's completion."""
    from busplan.rules.registry import all_rules

    return [code for code in all_rules() if code.startswith(incomplete)]


def rule_command(
    code: Annotated[
        str | None,
        typer.Argument(help="Code of a rule, as BP101.  [default: all of them]", autocompletion=complete_code),
    ] = None,
    format_: Annotated[
        Literal["text", "json"], typer.Option("--format", help="Form of the document on standard output.")
    ] = "text",
) -> None:
    """Explain a rule of `busplan check`: what is wrong, why it matters, and how to mend it.

    Without a code it lists all rules with their severity. A report: it exits 0.

    Example: busplan rule BP110
    """
    from busplan.answers import documents
    from busplan.answers.rules import rule_page, rule_rows, rule_table
    from busplan.forms import json_and_csv
    from busplan.rules.registry import all_rules

    rules = all_rules()
    if code is not None and code.upper() not in rules:
        raise BusplanError(f"{code}: no such rule; there are {', '.join(rules)}")
    chosen = list(rules.values()) if code is None else [rules[code.upper()]]
    if format_ == "json":
        emit_document(json_and_csv.to_json(documents.document("rule", rules=rule_rows(chosen))))
    else:
        emit_text(rule_table(chosen) if code is None else rule_page(chosen[0]))
