"""The commands that give a page's figures again, as a shell takes them."""

import os
import shlex
from collections.abc import Mapping
from typing import NamedTuple

from busplan.analysis.all_answers import AllAnswers
from busplan.analysis.capacity.verdict import verdicts
from busplan.answers.assumptions import assumptions_document
from busplan.answers.capacity import capacity_document
from busplan.answers.circle import circle_document
from busplan.answers.latency import latency_document
from busplan.answers.timeline import timeline_document
from busplan.forms.blocks import BlockOrPart, Command, JsonDocument, with_values
from busplan.printable import commands


class Source(NamedTuple):
    """One command, and the document that it writes: what figures are taken from."""

    command: Command
    document: JsonDocument

    def gives(self, block: BlockOrPart) -> BlockOrPart:
        """Say of every figure of a block that it stands in this document."""
        return with_values(block, lambda value: value._replace(command=self.command.key if value.at else ""))

    @property
    def line(self) -> Command:
        """The command for a reader to type, where it is not explained."""
        return Command(self.command.line)


Sources = Mapping[str, Source]
"""The commands behind a profile's figures, by a short name."""


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


def sources(answer: AllAnswers, *, argument: str, key: str, other_period: bool) -> dict[str, Source]:
    """List the commands behind one profile's figures, each with the document that it writes.

    Parameters
    ----------
    answer
        Everything that is said of the profile.
    argument
        The PROFILE argument.
    key
        Beginning of the ids.
    other_period
        Whether its period is not that of its file.
    """
    own = period_option(answer.profile.cycle.period_us) if other_period else ()
    each = tuple(word for (one, *_) in answer.periods.periods for word in period_option(one.period_us))
    found: dict[str, Source] = {}

    def add(name: str, purpose: str, document: JsonDocument, *options: str) -> None:
        words = ("busplan", str(document["command"]), shell_word(argument), *options, "--format", "json")
        found[name] = Source(Command(" ".join(words), purpose, f"{key}-{name}"), document)

    bus, periods = answer.capacity, answer.periods
    add("capacity", "verdict, timing models, terms", capacity_document(bus, (answer.verdict,)), *own)
    add("latency", "latencies, part by part", latency_document(answer.latency))
    if answer.schedule is not None:
        add("timeline", "the cycle event by event", timeline_document(answer.schedule), *own)
    add("axes", "axes against period", capacity_document(periods, verdicts(periods)), *each)
    if answer.circle is not None:
        document = circle_document(answer.circle, with_contributions=True)
        add("circle", "the circle and its error sources", document, "--contributions", *own)
    add("explain", "what the figures rest on", assumptions_document(answer.profile, answer.assumptions))
    return found
