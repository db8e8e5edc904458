"""Commands that teach: manual, profiles, evidence and paper."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import busplan
from busplan.cli.answering import require_apart
from busplan.cli.command import command
from busplan.cli.options import complete_kind, output_option
from busplan.cli.output import emit_document, emit_pages, progress_bar, say
from busplan.errors import BusplanError
from busplan.files import write_file

if TYPE_CHECKING:
    from busplan.forms.blocks import Report
    from busplan.questions.base.answer import Answer
    from busplan.sections.profile import Profile


def complete_topic(incomplete: str) -> list[str]:
    """Complete the name of a topic for the shell."""
    from busplan.manual import topics

    return [topic for topic in topics() if topic.startswith(incomplete)]


@command(of="nothing", answers=False)
def manual_command(
    topic: Annotated[
        str | None,
        typer.Argument(
            autocompletion=complete_topic,
            help="Topic of a page, as profile; start is the tour.  [default: a list of all of them]",
        ),
    ] = None,
    output: Annotated[Path | None, output_option("Write the page to FILE, always as Markdown")] = None,
) -> None:
    """Show a reference page: profile keys, timing models, the circle test, the plan, the gate, JSON, Python, limits.

    Pages are Markdown, set for reading and paged on a terminal. Without a topic it lists the topics. `busplan COMMAND
    --help` describes a command and its options. Exits 0 when the page is written.

    Example: busplan manual profile
    """
    from busplan.manual import TOUR, page, topics

    headings = topics()
    topic = TOUR if topic == "start" else topic
    if topic is not None and topic not in headings:
        from busplan.english import did_you_mean

        hints = "; ".join(filter(None, (f"there are {', '.join(headings)}", did_you_mean(topic, headings))))
        raise BusplanError(f"{topic or repr(topic)}: no such topic; {hints}")
    require_apart({"--output": output})
    if topic is None:
        width = max(map(len, headings))
        lines = (f"{name:{width}}  {heading}\n" for name, heading in headings.items())
        how = "`busplan manual TOPIC` shows one, `busplan manual start` the tour"
        text = f"Topics of the manual; {how}:\n\n{''.join(lines)}"
    else:
        text = page(topic)
    if output is not None:
        write_file(output, text.encode(), overwrite=True)
        say(f"wrote {output}")
    elif topic is not None and sys.stdout.isatty():
        from busplan.forms.pages import rendered

        emit_pages(rendered(text))
    else:
        emit_document(text)


@command(of="nothing")
def profiles_command() -> "Report":
    """List the shipped profiles, which every command takes by name.

    Each has its bus, nodes, axes and period; --all adds the description. Exits 0.

    Example: busplan profiles
    """
    from busplan.profile.sources import load, shipped_names

    return _profiles_report([load(name).profile for name in shipped_names()])


def _profiles_report(profiles: "list[Profile]") -> "Report":
    """Name, main figures and description of each profile."""
    from busplan.buses.figure import AXES, NODES
    from busplan.forms.blocks import Code, Report, Sentence, Table, TableColumn, TableRow, count_value
    from busplan.forms.numbers import period
    from busplan.questions.base.arguments import load_network
    from busplan.questions.base.sentences import document

    records, rows = [], []
    for profile in profiles:
        network, groups = load_network(profile), profile.node_groups
        nodes, axes = sum(group.nodes for group in groups), sum(group.nodes * group.node.axes for group in groups)
        description = " ".join(profile.description.split())
        period_us: Any = profile.cycle.period_us if profile.has_cycle else None
        title = network.bus.title_of(network)
        figures = {"name": profile.name, "bus": title, "nodes": nodes, "axes": axes, "period_us": period_us}
        records.append({**figures, "description": description})
        at = period(period_us) if period_us else ""
        counts = (count_value(nodes, NODES.key), count_value(axes, AXES.key))
        rows.append(TableRow((Code(profile.name), title, *counts, at, description)))
    columns = (
        *(TableColumn(heading, kind="words") for heading in ("profile", "bus")),
        *(TableColumn(heading) for heading in ("nodes", "axes", "period")),
        TableColumn("description", kind="words", rank=1, leaves="below", wraps=True, is_detail=True),
    )
    table = Table(columns, tuple(rows), Sentence(("Shipped profiles",)))
    return Report(Sentence(("Shipped profiles",)), (table,), document("profiles", profiles=records), records)


@command(of="nothing")
def evidence_command(
    kind: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_kind, help="Kind of bus, as ieee1394.  [default: all of them]"),
    ] = None,
) -> "Answer":
    """Compare published and measured figures of a kind of bus with the computed ones.

    Each figure has its grade, the way it is computed, and the residual, computed less published, also in percent. A
    kind without such a figure says so, here and in its verdicts. `busplan paper` shows the part of the paper. Exits 0
    whatever the residuals.

    Example: busplan evidence ieee1394
    """
    with progress_bar("circle tests") as progress:
        return busplan.evidence(kind, progress=progress)


@command(of="nothing")
def paper_command() -> "Answer":
    """Compare every figure of the paper that the equations give with the computed one.

    The figures are those of Table I and Table II, the comparison with CAN, the constant of equation (15), the gaps of
    equation (10), Figs. 9 and 10 and the comparison with SERCOS, each with its grade and the way it is computed. The
    residual is computed less published, also in percent. The servo values of the circles were calibrated to these very
    figures. This is the paper's part of `busplan evidence ieee1394`. Exits 0 whatever the residuals.

    Example: busplan paper --format csv
    """
    with progress_bar("circle tests") as progress:
        return busplan.evidence(paper=True, progress=progress)
