"""`import busplan`: what it loads and when, and what names it has."""

import pkgutil
import subprocess
import sys
from functools import cache
from importlib import import_module

import busplan

HEAVY = {"numpy", "pydantic", "rich", "typer", "click", "resvg_py", "scipy", "tomllib", "tomli_w", "json"}
FUNCTIONS = tuple(name for name in busplan.__all__ if name.islower() and not name.startswith("__"))
WITH_NUMPY = ("evidence", "sweep", "map_", "explore", "report", "recorded")
WITHOUT = tuple(name for name in FUNCTIONS if name not in WITH_NUMPY)


@cache
def loaded(program: str) -> set[str]:
    """Modules that a fresh interpreter has after a program."""
    return written(f"import sys\n{program}\nprint('\\n', *sys.modules)")[-1]


def written(program: str) -> list[set[str]]:
    """The words of each line that a fresh interpreter writes."""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return [set(line.split()) for line in done.stdout.splitlines()]


def test_the_package_alone_loads_nothing() -> None:
    found = loaded("import busplan; busplan.__version__; dir(busplan)")
    assert not found & HEAVY
    assert {name for name in found if name.startswith("busplan")} == {"busplan"}


def test_an_error_or_a_type_loads_no_analysis() -> None:
    assert {name for name in loaded("import busplan; busplan.BusplanError") if name.startswith("busplan")} == {
        "busplan",
        "busplan.errors",
    }
    assert not loaded("import busplan; busplan.Profile") & {"numpy", "busplan.questions", "busplan.forms"}


def test_a_name_loads_what_it_needs() -> None:
    without, with_numpy = written(
        "import sys, busplan\n"
        f"for names in {WITHOUT, WITH_NUMPY}:\n"
        "    for name in names:\n"
        "        getattr(busplan, name)\n"
        "    print(*sys.modules)\n"
    )
    assert "numpy" not in without
    assert not with_numpy & {"typer", "rich", "resvg_py", "busplan.cli"}


def test_what_simulates_nothing_loads_no_numpy() -> None:
    calls = [
        "latency('paper-4ms')",
        "capacity('paper-4ms', sensitivity=True)",
        "timeline('paper-4ms')",
        "plan('paper-4ms')",
        "check('paper-4ms', circle=False)",
        "diff('paper-4ms', 'paper-dma')",
        "compare('paper-4ms')",
        "explain('paper-4ms', 'required_us')",
        "calibrate('paper-two-node', 'table-1.csv')",
    ]
    program = "".join(f"\nstr(busplan.{call}.to_dict())" for call in calls)
    assert not loaded(f"import busplan{program}") & {"numpy", "typer", "rich", "resvg_py"}


def test_all_names_are_there_and_listed() -> None:
    assert set(busplan.__all__) <= set(dir(busplan))
    for name in busplan.__all__:
        assert getattr(busplan, name) is getattr(busplan, name)
    for name in FUNCTIONS:
        function = getattr(busplan, name)
        assert (function.__name__, function.__module__.startswith(("busplan.questions.", "busplan.gate."))) == (
            name,
            True,
        )


def test_functions_stay_functions_whatever_submodules_are_loaded() -> None:
    names = [name for _, name, _ in pkgutil.walk_packages(busplan.__path__, "busplan.") if "__main__" not in name]
    # A submodule of that name would take its place as soon as it is imported.
    assert not {name.removeprefix("busplan.") for name in names} & set(busplan.__all__)
    for name in names:
        import_module(name)
    assert all(callable(getattr(busplan, name)) for name in FUNCTIONS)
