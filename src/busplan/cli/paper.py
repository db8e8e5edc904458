"""`busplan paper`."""

from busplan.cli.options import FormatOption
from busplan.cli.output import emit, emit_text


def paper_command(format_: FormatOption = "table") -> None:
    """Show every published figure that the equations reach, beside the computed one and the residual.

    Table I and Table II, the comparison with CAN, the constant of equation (15) and the gaps of equation (10), each
    with the way it is computed. The residual is computed less published; the last column is its share in percent.

    Example: busplan paper --format csv
    """
    from busplan.analysis.paper import BENCH_PROFILE, paper_sections
    from busplan.profile.shipped import load

    sections = paper_sections(load(BENCH_PROFILE).profile)
    if format_ == "table":
        from busplan.report.paper import paper_lines

        emit(paper_lines(sections))
        return
    from busplan.report import documents, text

    emit_text(
        text.to_json(documents.paper_document(sections))
        if format_ == "json"
        else text.to_csv(documents.paper_rows(sections))
    )
