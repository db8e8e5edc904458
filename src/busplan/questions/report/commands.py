"""The shell commands that reproduce the figures of a page."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from busplan.forms.blocks import Command, JsonDocument
from busplan.profile.changes import KeyChanges
from busplan.questions.base.shell import change_options, period_option, shell_word
from busplan.questions.capacity.report import capacity_document
from busplan.questions.capacity.sensitivity_report import sensitivity_document
from busplan.questions.capacity.verdict import verdicts
from busplan.questions.circle.report import circle_document
from busplan.questions.explain.report import assumptions_document
from busplan.questions.latency.report import latency_document
from busplan.questions.map.report import map_document
from busplan.questions.report.all_answers import AllAnswers
from busplan.questions.timeline.report import timeline_document
from busplan.questions.words.documents import changed_document


class Source(NamedTuple):
    """A command and the JSON document that it writes."""

    command: Command
    document: Callable[[], JsonDocument]
    """Computed when it is asked for: it has figures that no page shows."""

    @property
    def line(self) -> Command:
        """The command without its purpose."""
        return Command(self.command.line)


Sources = Mapping[str, Source]
"""The commands behind a profile's figures, by a short name."""


def sources(answer: AllAnswers, *, argument: str, changes: KeyChanges) -> dict[str, Source]:
    """The commands behind one profile's figures, by a short name.

    Parameters
    ----------
    answer
        All answers of the profile.
    argument
        The PROFILE argument.
    changes
        KeyChanges of its file, which the commands repeat.
    """
    by_name: dict[str, Source] = {}

    def add(
        name: str,
        purpose: str,
        document: Callable[[], JsonDocument],
        *options: str,
        command: str | None = None,
        own: KeyChanges = changes,
    ) -> None:
        changed = change_options(own, period_us=answer.profile.cycle.period_us)
        words = ("busplan", command or name, shell_word(argument), *options, *changed, "--format", "json")
        by_name[name] = Source(Command(" ".join(words), purpose), lambda: changed_document(document(), own))

    # Neither latency nor the list of explain takes --period.
    elsewhere = KeyChanges(tuple(change for change in changes.each if change.option != "--period"))
    sensitivity = answer.sensitivity
    if sensitivity is None:
        add("capacity", "verdict and loads", lambda: capacity_document(answer.capacity, (answer.verdict,)))
    else:
        add(
            "capacity",
            "verdict, timing models, terms, what moves the margin",
            lambda: sensitivity_document(answer.capacity, (answer.verdict,), (sensitivity,)),
            "--sensitivity",
        )
    add("latency", "latencies, part by part", lambda: latency_document(answer.latency), own=elsewhere)
    schedule, circle = answer.schedule, answer.circle
    if schedule is not None:
        add("timeline", "the cycle event by event", lambda: timeline_document(schedule))
    trade_off = answer.trade_off
    if trade_off is not None:
        add(
            "axes",
            "axes against period",
            lambda: capacity_document(answer.periods, verdicts(answer.periods)),
            *(word for (figures, *_) in answer.periods.periods for word in period_option(figures.period_us)),
            command="capacity",
            own=changes.without(key="cycle.period_us"),
        )
        add("map", "period against axes, cell by cell", lambda: map_document(trade_off))
    if circle is not None:
        purpose = "the circle and its error sources"
        add("circle", purpose, lambda: circle_document(circle), "--contributions", command="circle-test")
    assumptions = answer.assumptions
    add("explain", "what the figures rest on", lambda: assumptions_document(answer.profile, assumptions), own=elsewhere)
    return by_name
