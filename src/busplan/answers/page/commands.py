"""The commands that give a page's figures again, as a shell takes them."""

import os
import shlex

from busplan.analysis.all_answers import AllAnswers
from busplan.analysis.capacity.verdict import verdicts
from busplan.answers import documents
from busplan.answers.explain import figure_document
from busplan.answers.page.content import SourceCommand
from busplan.answers.timeline import timeline_document
from busplan.printable import commands


def shell_word(text: str) -> str:
    """Quote an argument for a shell.

    Examples
    --------
    >>> shell_word("line 1.toml"), shell_word("-x.toml"), shell_word("-")
    ("'line 1.toml'", './-x.toml', '-')
    """
    if text.startswith("-") and text != "-":
        # No shell quoting keeps a program from taking it for an option.
        text = f"./{text}"
    if not commands(text):
        return shlex.quote(text)
    # Bytes that no page can show; bash, zsh and POSIX of 2024 read them in this form.
    return f"$'{''.join(map(_escaped, os.fsencode(text)))}'"


def _escaped(byte: int) -> str:
    character = chr(byte)
    return character if character.isascii() and (character.isalnum() or character in "/._-+ ") else f"\\x{byte:02x}"


def period_option(period_us: float) -> tuple[str, str]:
    """The option that gives exactly this period.

    Examples
    --------
    >>> period_option(500.0), period_option(0.1)
    (('--period', '500us'), ('--period', '0.1us'))
    """
    return "--period", f"{repr(period_us).removesuffix('.0')}us"


def sources(answer: AllAnswers, *, argument: str, anchor: str, other_period: bool) -> tuple[SourceCommand, ...]:
    """List the commands behind one profile's figures, each with the document that it writes.

    Parameters
    ----------
    answer
        Everything that is said of the profile.
    argument
        The PROFILE argument.
    anchor
        Prefix of the ids.
    other_period
        Whether its period is not that of its file.
    """
    own = period_option(answer.profile.cycle.period_us) if other_period else ()
    each = tuple(word for (one, *_) in answer.periods.periods for word in period_option(one.period_us))

    def source(name: str, purpose: str, document: documents.Document, *options: str) -> SourceCommand:
        words = ("busplan", str(document["command"]), shell_word(argument), *options, "--format", "json")
        return SourceCommand(f"{anchor}-{name}", " ".join(words), purpose, document)

    bus, periods = answer.capacity, answer.periods
    found = [
        source("capacity", "verdict, timing models, terms", documents.capacity_document(bus, (answer.verdict,)), *own),
        source("latency", "latencies, part by part", documents.latency_document(answer.latency)),
    ]
    if answer.schedule is not None:
        found.append(source("timeline", "the cycle event by event", timeline_document(answer.schedule), *own))
    found.append(source("axes", "axes against period", documents.capacity_document(periods, verdicts(periods)), *each))
    if answer.circle is not None:
        document = documents.circle_document(answer.circle, with_contributions=True)
        found.append(source("circle", "the circle and its error sources", document, "--contributions", *own))
    found.append(source("explain", "what the figures rest on", figure_document(answer.profile, answer.assumptions)))
    return tuple(found)
