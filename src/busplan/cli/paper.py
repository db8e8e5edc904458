"""`busplan paper`."""

from busplan.cli.answering import answer
from busplan.cli.options import AllOption, FormatOption, OutputOption
from busplan.cli.progress import progress_bar


def paper_command(all_: AllOption = False, format_: FormatOption = None, output: OutputOption = None) -> None:
    """Compare every figure of the paper that the equations give with the computed one.

    The figures are those of Table I and Table II, the comparison with CAN, the constant of equation (15), the gaps of
    equation (10), Figs. 9 and 10 and the comparison with SERCOS, each with its grade and the way it is computed. The
    residual is computed less published, also in percent. The servo values of the circles were calibrated to these very
    figures. This is the paper's part of `busplan evidence ieee1394`. Exits 0 with any residuals.

    Example: busplan paper --format csv
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.questions.evidence import evidence

        with progress_bar("circle tests") as progress:
            known = evidence(paper=True, progress=progress)
        give(known.report())
