"""A CAN log written frame by frame. It imports nothing of busplan."""

from pathlib import Path
from typing import Any, NamedTuple

import tomli_w

from tests.oracles.can_frames import written_bits

DATA = b"\x55" * 8


class Frame(NamedTuple):
    """A frame of a log."""

    identifier: int
    size: int
    extended: bool
    bits: int


class Log:
    """Frames at 1000 kbit/s, one after the other: a bit is a microsecond. Stamps count from 0."""

    def __init__(self) -> None:
        self.us = 0
        self.lines = list[str]()
        self.frames = list[Frame]()

    def error(self, after_us: int) -> None:
        """An error frame some time behind the one before."""
        self.us += after_us
        self.lines.append(f"({self.us / 1e6:.6f}) can0 20000080#0000000000000000\n")

    def frame(
        self, after_us: int, identifier: int, size: int = 8, *, extended: bool = False, is_sent: bool = True
    ) -> None:
        """A frame that begins some time behind the one before, stamped at its end; its time alone, if it is lost."""
        bits = written_bits(identifier, DATA[:size], identifier_bits=29 if extended else 11)
        self.us += after_us + bits
        if not is_sent:
            return
        self.frames.append(Frame(identifier, size, extended, bits))
        name = f"{identifier:08X}" if extended else f"{identifier:03X}"
        self.lines.append(f"({self.us / 1e6:.6f}) can0 {name}#{DATA[:size].hex()}\n")

    def save(self, folder: Path, plan: dict[str, Any]) -> tuple[Path, Path]:
        """Write a plan and the log; their paths."""
        paths = folder / "plan.toml", folder / "bus.log"
        paths[0].write_text(tomli_w.dumps(plan))
        paths[1].write_text("".join(self.lines))
        return paths
