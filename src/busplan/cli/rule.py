"""`busplan rule`."""

from typing import Annotated

import typer

from busplan.cli.answering import answer
from busplan.cli.options import AllOption, FormatOption, OutputOption
from busplan.errors import BusplanError


def complete_code(incomplete: str) -> list[str]:
    """Complete the code of a rule for the shell."""
    from busplan.gate.registry import all_rules

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

    Without a code it lists all rules with their severity. A report: it exits 0.

    Example: busplan rule BP110
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.gate.registry import all_rules
        from busplan.gate.rules_report import rule_report, rules_report

        rules = all_rules()
        if code is None:
            give(rules_report(list(rules.values())))
            return
        named = {**rules, **{rule.name.upper(): rule for rule in rules.values()}}
        if code.upper() not in named:
            from busplan.nearest import did_you_mean

            known = (*rules, *(rule.name for rule in rules.values()))
            hint = " ".join(filter(None, (did_you_mean(code, known), "`busplan rule` lists them")))
            raise BusplanError(f"{code}: no such rule; {hint}")
        give(rule_report(named[code.upper()]))
