"""Every command answers on the shipped profile of each kind of bus but IEEE 1394, which the other tests ask."""

from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CompletedProcess

import pytest

KINDS = ("can", "ethercat", "sercos3", "sercos2")
QUESTIONS = {
    "capacity --sensitivity": ("table", "json", "csv"),
    "latency": ("table", "csv"),
    "plan": ("table", "json"),
    "timeline": ("table", "markdown", "svg"),
    "map": ("markdown", "svg"),
    "report": ("html", "markdown"),
    "check": ("concise", "sarif"),
    "explain": ("table", "json"),
    "diff paper-4ms": ("table", "json"),
    "circle-test": ("table",),
}
SWEEPS = (
    ("can", "bus.bit_rate_kbit_s=500,1000 --vary message.sdo-request.period_us=1000,20000"),
    ("ethercat", "bus.process_data=LRW-shared,LRD-LWR --vary bus.distributed_clocks=true,false --vary bus.nodes=1,9"),
    ("ethercat", "node.cable_m=0:100:50 --vary node.port=100BASE-TX,E-bus --vary cycle.period_us=250,1000"),
)


def asked() -> Iterator[tuple[str, str, str]]:
    """A kind, a question and a form: of each kind a report and half the others, of all kinds together every form."""
    for row, (line, forms) in enumerate(QUESTIONS.items()):
        for place, kind in enumerate(KINDS):
            # A report holds the answers to most questions.
            if line == "report" or (row + place) % 2:
                yield kind, line, forms[(row + place // 2) % len(forms)]
    for (kind, varied), form in zip(SWEEPS, ("csv", "table", "csv"), strict=True):
        yield kind, f"sweep --vary {varied}", form


@pytest.mark.parametrize(("kind", "line", "form"), list(asked()))
def test_every_question_is_answered(
    run: Callable[..., CompletedProcess[str]], tmp_path: Path, kind: str, line: str, form: str
) -> None:
    command, *options = line.split()
    done = run(command, f"{kind}-servo-8", *options, "--format", form, cwd=tmp_path)
    assert done.returncode in (0, 1) if command == "check" else done.returncode == 0, done
    assert "gap count" not in done.stdout or command in ("check", "diff")
    assert "nan" not in done.stdout.lower().split()
