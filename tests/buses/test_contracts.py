"""The import contracts know every kind of bus, also one that nobody has named yet."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = "imports run one way through the room of each bus"


def contract(name: str) -> dict[str, list[str]]:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (found,) = (one for one in settings["tool"]["importlinter"]["contracts"] if one["name"] == name)
    return dict(found)


def test_the_rooms_of_all_buses_are_ordered() -> None:
    rooms = {one.parent.name for one in (ROOT / "src/busplan/buses").glob("*/__init__.py")}
    assert {name.rpartition(".")[2] for name in contract(ROOMS)["containers"]} == rooms


def broken(tmp_path: Path, imports: dict[str, str]) -> str:
    """What the contracts say of a package with another kind of bus, and with more imports."""
    source = tmp_path / "src"
    shutil.copytree(ROOT / "src", source, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (source / "busplan/buses/invented").mkdir()
    for name in ("__init__", "cycle", "kind"):
        (source / f"busplan/buses/invented/{name}.py").write_text('"""Invented."""\n', encoding="utf-8")
    for importer, imported in imports.items():
        with (source / importer).open("a", encoding="utf-8") as file:
            file.write(f"import {imported}\n")
    program = "import sys; sys.path.insert(0, 'src'); from importlinter.cli import lint_imports_command as main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, "--no-cache"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1, done.stdout + done.stderr
    return done.stdout


def test_an_invented_kind_is_held_to_the_contracts(tmp_path: Path) -> None:
    imports = {
        "busplan/questions/latency.py": "busplan.buses.invented.cycle",
        "busplan/buses/invented/cycle.py": "pydantic",
    }
    report = broken(tmp_path, imports)
    for importer, imported in imports.items():
        assert f"{importer.removesuffix('.py').replace('/', '.')} -> {imported}" in report
    # Beside the other kinds it must be named: no kind knows another.
    assert "busplan.buses.invented" in report.partition("exhaustive")[0]
