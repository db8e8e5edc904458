"""A sweep as a NumPy archive of columns, written block by block in flat memory.

Each column grows in a temporary file of its own beside the target, and all are put together at the end: the archive
needs a column's length before the column.
"""

import shutil
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile, gettempdir
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Protocol, Self

from busplan.errors import BusplanError

if TYPE_CHECKING:
    from types import TracebackType

    from busplan.analysis.sweep.blocks import Block

_COPIED_AT_ONCE: Final = 1 << 20


class Archive(Protocol):
    """Where an archive is written."""

    def write(self, data: bytes, /) -> int:
        """Take more bytes."""

    def flush(self) -> None:
        """Hold nothing back."""

    def close(self) -> None:
        """Take no more."""


class NpzColumns:
    """Columns on their way into an archive.

    Parameters
    ----------
    columns
        Which columns of a block.
    folder
        Where there is room for them; None for the folder of temporary files.
    """

    def __init__(self, columns: Sequence[str], *, folder: Path | None) -> None:
        self._columns, self._folder = columns, folder
        self._stack = ExitStack()
        self._files: dict[str, BinaryIO] = {}
        self._types: dict[str, Any] = {}
        self._words: dict[str, tuple[Any, ...]] = {}
        self._rows = 0

    def __enter__(self) -> Self:
        with self._named():
            for name in self._columns:
                self._files[name] = self._stack.enter_context(TemporaryFile(dir=self._folder))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: "TracebackType | None"
    ) -> None:
        with suppress(OSError):  # what was not written is not wanted any more
            self._stack.close()

    def add(self, block: "Block") -> None:
        """Append a block's rows to each column."""
        import numpy as np

        for name in self._columns:
            values = block.rows(name)
            words = [column.words for column in block.columns(name)]
            if words[0] is not None:
                values = self._places(name, values, words, models=len(block.models))
            self._types.setdefault(name, values.dtype)
            with self._named():
                self._files[name].write(np.ascontiguousarray(values).data)
        self._rows += block.chunk.points * len(block.models)

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Say whose disk is full."""
        try:
            yield
        except OSError as error:
            folder = self._folder or gettempdir()
            raise BusplanError(f"columns in {folder}: cannot be written: {error.strerror}") from None

    def _places(self, name: str, values: Any, words: Sequence[Any], *, models: int) -> Any:
        """Places of a column's words in one list of them for all blocks and models."""
        import numpy as np

        known = dict.fromkeys(self._words.get(name, ()))
        spelled = [[_spelled(word) for word in own] for own in words]
        known |= dict.fromkeys(word for own in spelled for word in own)
        self._words[name] = tuple(known)
        place = {word: index for index, word in enumerate(known)}
        found = values.reshape(-1, models)
        columns = [
            np.array([place[word] for word in own], dtype=np.uint8)[found[:, number]]
            for number, own in enumerate(spelled)
        ]
        return np.stack(columns, axis=1).ravel()

    def write(self, file: Archive, facts: Mapping[str, object]) -> None:
        """Put the archive together.

        Parameters
        ----------
        file
            The archive.
        facts
            Single values that go in beside the columns.
        """
        import numpy as np

        single = {name: np.array(value) for name, value in facts.items()}
        single |= {f"{name}_words": np.array(words) for name, words in self._words.items()}
        with zipfile.ZipFile(file, "w") as archive:
            for name, array in single.items():
                with archive.open(f"{name}.npy", "w") as member:
                    np.lib.format.write_array(member, array, allow_pickle=False)
            for name, column in self._files.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    dtype = np.lib.format.dtype_to_descr(self._types.get(name, np.dtype(float)))
                    header = {"descr": dtype, "fortran_order": False, "shape": (self._rows,)}
                    np.lib.format.write_array_header_1_0(member, header)
                    with self._named():
                        column.seek(0)
                    shutil.copyfileobj(column, member, _COPIED_AT_ONCE)


def _spelled(word: Any) -> str:
    return " ".join(word) if isinstance(word, list) else str(word)
