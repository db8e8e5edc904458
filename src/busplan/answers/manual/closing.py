"""What the manual says behind the pages of the commands, because it holds for all of them."""

from collections.abc import Sequence
from typing import Final

from busplan.analysis.register import figures_of
from busplan.answers.manual.pages import Entry, ManualSection
from busplan.buses import kind_named, kind_names
from busplan.buses.figure import Figure, by_key
from busplan.profile.shipped import shipped_names

_EXIT_STATUS: Final = ManualSection(
    "Exit status",
    (
        "The page of a command says when it exits 0 and when 1.",
        "The document goes to standard output, all else to standard error.",
    ),
    (
        Entry(("0",), "", "Done; of a report, whatever the verdict in it."),
        Entry(("1",), "", "The plan fails: a tolerance is missed, a profile has findings, or no plan fits."),
        Entry(("2",), "", "It could not do its job: bad usage, a bad file, a full disk. Standard error says why."),
        Entry(("130",), "", "Interrupted."),
    ),
)
_COLOURS: Final = (
    Entry(("NO_COLOR",), "", "Set to anything, it turns colours off."),
    Entry(("FORCE_COLOR",), "", "Set to anything but 0, it turns colours on where the output is no terminal."),
    Entry(("COLUMNS",), "", "Width of help and of reports on a terminal [characters], instead of the terminal's own."),
)
_COMPLETION: Final = Entry(
    ("_BUSPLAN_COMPLETE",),
    "",
    "Set by the completion script of a shell, which --install-completion puts in place; not for use by hand.",
)
_FIGURES: Final = (
    "Keys of the JSON of `busplan capacity`, `busplan latency` and `busplan circle-test`, with what they are, their "
    "unit and the equation that they come from. `busplan explain` derives each of them."
)
_PAPER: Final = (
    'G. Gu, L. Zhu, Z. Xiong and H. Ding, "Design of a Distributed Multiaxis Motion Control System Using the '
    'IEEE-1394 Bus", IEEE Transactions on Industrial Electronics 57 (12), December 2010, pp. 4209 ff.: the paper '
    "whose equations the reports name."
)
_STANDARDS: Final = "IEEE Std 1394-1995 and 1394a-2000 for the bus, ISO 230-4 for the measures of the circle test."
_SEE_ALSO: Final = ManualSection("See also", (_PAPER, _STANDARDS), ())


def closing_sections(variables: Sequence[Entry]) -> tuple[ManualSection, ...]:
    """Exit status, figures, environment, files, and what else to read.

    Parameters
    ----------
    variables
        Variables of the environment that stand for an option.
    """
    environment = ManualSection("Environment", (), (*variables, *_COLOURS, _COMPLETION))
    return (_EXIT_STATUS, _figures(), environment, _files(), _SEE_ALSO)


def _figures() -> ManualSection:
    """Every figure of the register, each once."""
    registers = (figures_of(kind_named(kind)) for kind in kind_names())
    figures = by_key(figure for one in registers for command in one.values() for figure in command.values())
    return ManualSection(
        "Figures",
        (_FIGURES,),
        tuple(Entry((figure.key,), "", _about(figure)) for figure in figures.values()),
    )


def _about(figure: Figure) -> str:
    unit = f" [{figure.unit}]" if figure.unit else ""
    better = "" if figure.better == "neither" else f"; {figure.better} is better"
    return f"{figure.meaning}{unit}; {figure.reference}{better}."


def _files() -> ManualSection:
    return ManualSection(
        "Files",
        (),
        (
            Entry(
                ("NAME.toml",),
                "",
                "A profile: one network with its host, nodes, cycle, payloads and, for the circle test, its servo. "
                "`busplan init` writes one, and `busplan schema` says what may stand in it.",
            ),
            Entry(
                tuple(shipped_names()),
                "",
                "Shipped profiles, inside the package. Such a name always means the shipped profile: a file of your "
                "own that is called so needs its path, as `./paper-4ms.toml`.",
            ),
            Entry(("table-1.csv",), "", "Shipped measurements, for `busplan calibrate`."),
            Entry(
                ("share/man/man1/busplan.1", "busplan/_manual/reference.md"),
                "",
                "This manual as it is installed: as a man page beside the program, and as Markdown inside the package.",
            ),
        ),
    )
