"""Finished circle tests of a sweep, kept beside its file until that is complete, also if the process is killed."""

import io
import json
import os
from contextlib import ExitStack, contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from busplan import __version__
from busplan.cli.output import say
from busplan.errors import BusplanError
from busplan.files import lock, naming_errors, write_file
from busplan.profile.write import profile_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from busplan.cli.sweep_run import SweepJob
    from busplan.questions.sweep.grid import Array, Values

_MANIFEST: Final = "sweep.json"
_OFTEN_S: Final = 1.0
"""Shortest time between two parts: however many processes there are, a second makes one file."""


def parts_path(output: Path) -> Path:
    """Folder of the parts of a file: rows.csv.parts."""
    return output.with_name(f"{output.name}.parts")


@contextmanager
def kept_parts(job: "SweepJob", output: Path) -> "Iterator[Parts]":
    """Give the parts of a sweep to this run alone, and remove them when its file is complete.

    Raises
    ------
    BusplanError
        As `Parts`, or another run has them.
    """
    with ExitStack() as stack:
        parts = Parts(job, output, lambda: stack.enter_context(_locked(parts_path(output), output)))
        yield parts
        parts.remove()


@contextmanager
def _locked(folder: Path, output: Path) -> "Iterator[None]":
    """Keep other runs out of a folder; it is made for that, and removed if it stays empty."""
    with naming_errors(output, folder):
        if not folder.exists():
            folder.mkdir(exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY)
    try:
        if not _is_ours(descriptor, folder):
            raise BusplanError(f"{folder}: another run is at this sweep; wait for its end, or give another --output")
        try:
            yield
        finally:
            with suppress(OSError):
                folder.rmdir()
    finally:
        os.close(descriptor)


def _is_ours(descriptor: int, folder: Path) -> bool:
    try:
        is_locked = lock(descriptor)
    except OSError as error:  # some network file systems have no locks
        say(f"{folder}: cannot be locked ({error.strerror}); let no other run write it meanwhile")
        return True
    # A run that has just ended may have removed the locked folder.
    return is_locked and folder.exists() and os.path.samestat(os.fstat(descriptor), folder.stat())


class Parts:
    """Results of circle tests in a folder: some chunks a file, written beside and renamed.

    A part is a NumPy file of shape (tests, 1 + CIRCLE_COLUMNS): the number of the test in the order of the grid, and
    its results. Thus parts depend neither on the size of the chunks nor on who ran them.

    Parameters
    ----------
    job
        The sweep; it has an output file.
    output
        That file.
    claim
        Makes the folder, and keeps other runs out of it.

    Raises
    ------
    BusplanError
        There are parts, and they are of another sweep, or are not to be used.
    """

    def __init__(self, job: "SweepJob", output: Path, claim: "Callable[[], None]") -> None:
        self.folder = parts_path(output)
        self._claim, self._is_ours = claim, self.folder.exists()
        if self._is_ours:
            claim()
        self._facts = _facts(job)
        self._pending: list[Array] = []
        self._written_s = -_OFTEN_S
        self._parts = [_opened(path) for path in self._checked(resume=job.resume)]
        numbers = [part[:, 0] for part in self._parts]
        self._numbers, self._rows = np.unique(np.concatenate(numbers or [np.empty(0)]), return_index=True)
        self._starts = np.cumsum([0, *(len(part) for part in self._parts)])
        self.tests = self._numbers.size
        """Circle tests in the folder."""

    def __contains__(self, test: int) -> bool:
        """Whether a test was in the folder at the start, by its number."""
        place = np.searchsorted(self._numbers, test)
        return bool(place < self._numbers.size and self._numbers[place] == test)

    def results(self, start: int, count: int) -> "Array":
        """Results of tests that were in the folder at the start."""
        place = int(np.searchsorted(self._numbers, start))
        rows = self._rows[place : place + count]
        parts = np.searchsorted(self._starts, rows, side="right") - 1
        return np.array(
            [self._parts[part][row - self._starts[part], 1:] for part, row in zip(parts, rows, strict=True)]
        )

    def add(self, start: int, results: "Array") -> None:
        """Keep the results of a chunk, in a file at least once a second."""
        self._pending.append(np.column_stack((np.arange(start, start + len(results)), results)))
        if monotonic() - self._written_s >= _OFTEN_S:
            self.flush()

    def flush(self) -> None:
        """Write the results that are not in the folder yet.

        Raises
        ------
        BusplanError
            It cannot be written.
        """
        if not self._pending:
            return
        part = np.concatenate(self._pending)
        self._pending = []
        content = io.BytesIO()
        np.save(content, part)
        if not self._is_ours:
            self._claim()
            self._is_ours = True
        if not (self.folder / _MANIFEST).exists():
            write_file(self.folder / _MANIFEST, json.dumps(self._facts, indent=2).encode(), overwrite=True)
        # No other part has this test, so none has this name.
        write_file(self.folder / f"{int(part[0, 0]):012}.npy", content.getvalue(), overwrite=True)
        self.tests += len(part)
        self._written_s = monotonic()

    def remove(self) -> None:
        """Remove the parts: their file is complete."""
        with suppress(OSError):
            for path in (*self.folder.glob("*.npy"), self.folder / _MANIFEST):
                path.unlink(missing_ok=True)

    def _checked(self, *, resume: bool) -> list[Path]:
        """Parts of an earlier run to go on with."""
        try:
            inside = list(self.folder.iterdir())
        except FileNotFoundError:
            return []
        except OSError as error:
            raise BusplanError(f"{self.folder}: cannot be read: {error.strerror}") from None
        parts = sorted(path for path in inside if path.suffix == ".npy")
        if not inside:
            return []
        manifest = self.folder / _MANIFEST
        if not manifest.exists():
            raise BusplanError(f"{self.folder}: the parts of this sweep would be kept here; move what is in it")
        if not resume:
            raise BusplanError(
                f"{self.folder}: has circle tests of a sweep that did not end; go on with --resume, "
                "or delete the folder"
            )
        try:
            theirs = json.loads(manifest.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise BusplanError(f"{manifest}: cannot be read: {error}; delete the folder") from None
        their_facts = theirs if isinstance(theirs, dict) else {}
        differing = [_difference(name, their_facts.get(name), own) for name, own in self._facts.items()]
        if any(differing):
            raise BusplanError(
                f"--resume: {self.folder} is of a sweep with {', '.join(filter(None, differing))}; repeat the "
                "command as it was, or delete the folder"
            )
        return parts


def _opened(path: Path) -> "Array":
    """Open a part, whose rows are read when they are needed."""
    try:
        part: Array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise BusplanError(f"{path}: is no part of a sweep: {error}; delete it") from None
    return part


def _facts(job: "SweepJob") -> dict[str, Any]:
    """Facts that a resumed sweep must share, by their names in messages."""
    return {
        "version of busplan": __version__,
        "profile": sha256(profile_text(job.sweep.profile).encode()).hexdigest(),
        "grid": {key: _axis(axis) for key, axis in job.sweep.grid.axes.items()},
        "range of seeds": None if job.sweep.seeds is None else _axis(job.sweep.seeds),
        "choice of timing models": list(job.sweep.timing_models),
        "set of columns": list(job.sweep.columns),
        "form": job.form,
    }


def _axis(axis: "Values") -> list[object]:
    return [type(axis).__name__, *(list(part) if isinstance(part, tuple) else part for part in axis)]


def _difference(name: str, theirs: object, ours: object) -> str | None:
    if theirs == ours:
        return None
    values = f" ({theirs} there, {ours} here)" if name in ("version of busplan", "form") else ""
    return f"another {name}{values}"
