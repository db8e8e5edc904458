"""Writers of every row of a sweep, block by block, one for each form."""

from collections.abc import Callable
from typing import Protocol

from busplan.forms import RowsForm
from busplan.questions.sweep.asked import Sweep
from busplan.questions.sweep.blocks import SweepBlock
from busplan.questions.sweep.rows import TextWriter


class RowsWriter(Protocol):
    """Writes the rows of a sweep; nothing before the first block, for a point may be refused."""

    points: int
    """Good size of a block."""

    def add(self, block: SweepBlock) -> None:
        """Write a block; blocks come in the order of the grid."""

    def finish(self, *, complete: bool) -> None:
        """Write what stands behind the rows: the file is valid, and says if it is not complete."""


def rows_writer(form: RowsForm, sweep: Sweep, write: Callable[[bytes], object]) -> RowsWriter:
    """Make the writer of a form.

    Parameters
    ----------
    form
        The form.
    sweep
        What the rows are of.
    write
        Writes bytes to the destination.
    """
    if form != "parquet":
        return TextWriter(form, sweep, write)
    from busplan.questions.sweep.parquet import ParquetWriter

    return ParquetWriter(sweep, write)
