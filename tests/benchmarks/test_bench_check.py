"""`busplan check` on 1,000 profiles, as a ratio against `check-jsonschema` on the same files, in the same run.

That one checks the shape alone. The figures are read from the report; nothing here fails because a machine is slow. The
budget is 1.0, for the whole process and for each file beyond the first.
"""

import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tests.registers import SHIPPED_FOLDER

FILES = 1000
ROUNDS = 3
SCHEMA = Path(__file__).resolve().parents[2] / "profiles" / "busplan.schema.json"
SHIPPED = [path.read_text(encoding="utf-8") for path in sorted(SHIPPED_FOLDER.glob("*.toml"))]

pytestmark = pytest.mark.skipif(find_spec("check_jsonschema") is None, reason="check-jsonschema is not installed")


@pytest.fixture(params=["clean", "every third with findings"])
def folder(request: pytest.FixtureRequest, tmp_path: Path, size: Callable[[int, int], int]) -> Path:
    for number in range(size(FILES, 30)):
        text = SHIPPED[number % len(SHIPPED)].replace("\nname = ", f"\nname = '{number}' #", 1)
        if request.param != "clean" and number % 3 == 0:
            # Still of the right shape: one cycle that does not fit, and a payload of no whole number of quadlets.
            text = text.replace("period_us = ", "period_us = 200 #").replace("read_bytes = ", "read_bytes = 7 #")
        (tmp_path / f"{number:04}.toml").write_text(text, encoding="utf-8")
    return tmp_path


def seconds(command: list[str], *, cwd: Path) -> float:
    start = perf_counter()
    run = subprocess.run(command, cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
    assert run.returncode in (0, 1), run.stderr
    return perf_counter() - start


def test_a_thousand_profiles(benchmark: BenchmarkFixture, folder: Path) -> None:
    names = sorted(path.name for path in folder.iterdir())
    ours = [sys.executable, "-m", "busplan", "check", "--no-circle", *names]
    theirs = [sys.executable, "-m", "check_jsonschema", "--schemafile", str(SCHEMA), *names]
    # One file is the start-up, which the others do not pay again.
    one = {"ours": ours[: 1 - len(names)], "theirs": theirs[: 1 - len(names)]}
    least = dict.fromkeys(("theirs", "one of ours", "one of theirs"), float("inf"))

    def take_turns() -> None:
        # In turns, so that a busy moment of the machine meets all of them.
        for name, command in (("theirs", theirs), ("one of ours", one["ours"]), ("one of theirs", one["theirs"])):
            least[name] = min(least[name], seconds(command, cwd=folder))

    benchmark.pedantic(lambda: seconds(ours, cwd=folder), setup=take_turns, rounds=ROUNDS)
    if benchmark.stats is None:  # run, and not measured
        return
    whole = benchmark.stats.stats.min
    a_file, their_file = whole - least["one of ours"], least["theirs"] - least["one of theirs"]
    benchmark.extra_info["ratio_to_check_jsonschema_whole_process"] = round(whole / least["theirs"], 3)
    benchmark.extra_info["ratio_to_check_jsonschema_per_file"] = round(a_file / their_file, 3)
    benchmark.extra_info["ms_per_file"] = round(1e3 * a_file / (len(names) - 1), 3)
