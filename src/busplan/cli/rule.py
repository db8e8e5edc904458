"""`busplan rule`."""

from typing import Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.options import AllOption, FormatOption, OutputOption


def complete_code(incomplete: str) -> list[str]:
    """Complete the code of a rule for the shell."""
    from busplan.gate.rules import all_rules

    return [code for code in all_rules() if code.startswith(incomplete)]


def rule_command(
    code: Annotated[
        str | None,
        typer.Argument(
            help="Code or name of a rule, as BP101 or syntax.  [default: all of them]", autocompletion=complete_code
        ),
    ] = None,
    all_: AllOption = False,
    format_: FormatOption = None,
    output: OutputOption = None,
) -> None:
    """Explain a rule of `busplan check`: what is wrong, why it matters, and how to mend it.

    Without a code it lists all rules with their severity. Exits 0.

    Example: busplan rule BP110
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.gate.rules import rule_answer

        give(rule_answer(code))
