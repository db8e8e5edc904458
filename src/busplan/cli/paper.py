"""`busplan paper`."""

from busplan.cli.answering import answer
from busplan.cli.options import AllOption, FormatOption, OutputOption
from busplan.cli.progress import progress_bar


def paper_command(all_: AllOption = False, format_: FormatOption = None, output: OutputOption = None) -> None:
    """Show every published figure that the equations reach, beside the computed one and the residual.

    Table I and Table II, the comparison with CAN, the constant of equation (15), the gaps of equation (10), Figs. 9 and
    10 and the comparison with SERCOS, each with the way it is computed. The residual is computed less published; the
    last column is its share in percent. The servo values behind the circles are a calibration to these very figures. A
    report: it exits 0 whatever the residuals are.

    Example: busplan paper --format csv
    """
    with answer(format_, output, is_whole=all_) as give:
        from busplan.analysis.circle.roundness import circle_test
        from busplan.analysis.paper import BENCH_PROFILE, CIRCLE_PROFILES, paper_sections
        from busplan.answers.paper import paper_report
        from busplan.profile.shipped import load

        with progress_bar("circle tests") as progress:
            circles = [circle_test(load(name).profile, progress=progress).results[0] for name in CIRCLE_PROFILES]
        give(paper_report(paper_sections(load(BENCH_PROFILE).profile, circles=circles)))
