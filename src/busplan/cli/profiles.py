"""`busplan profiles`."""

from busplan.cli.answering import answer
from busplan.cli.options import FormatOption, OutputOption


def profiles_command(format_: FormatOption = None, output: OutputOption = None) -> None:
    """List the shipped profiles, which every command takes by name.

    Each has its number of nodes, its period, its leading timing model and a description. Exits 0.

    Example: busplan profiles
    """
    with answer(format_, output) as give:
        from busplan.cli.profiles_report import profiles_report
        from busplan.profile.shipped import load, shipped_names

        give(profiles_report([load(name).profile for name in shipped_names()]))
