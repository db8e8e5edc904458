"""`save` writes what the command writes with -o, and never harms an old file."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

import busplan
from tests.extras import needed

Run = Callable[..., object]
COMMANDS: Mapping[str, Callable[[], Any]] = {
    "map paper-4ms --x axes=4:12:4 --y cycle.period_us=1000,4000": lambda: busplan.map_(
        "paper-4ms", x={"axes": "4:12:4"}, y={"cycle.period_us": [1000, 4000]}
    ),
    "compare paper-4ms --buses ieee1394,can": lambda: busplan.compare("paper-4ms", buses=["ieee1394", "can"]),
    "timeline paper-4ms --transaction read:1": lambda: busplan.timeline("paper-4ms", transaction=("read", 1)),
    "sweep paper-4ms --vary bus.nodes=1:9": lambda: busplan.sweep("paper-4ms", vary={"bus.nodes": "1:9"}),
    "circle-test paper-4ms": lambda: busplan.circle_test("paper-4ms"),
}
FILES = [
    *((name, ending) for name in list(COMMANDS)[:3] for ending in (".png", ".svg")),
    *(("sweep paper-4ms --vary bus.nodes=1:9", ending) for ending in (".csv", ".json", ".parquet")),
    ("circle-test paper-4ms", ".png"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("command", "ending"), FILES)
def test_a_file_has_the_bytes_that_the_command_writes(command: str, ending: str, run: Run, tmp_path: Path) -> None:
    if ending == ".parquet":
        needed("pyarrow")
    theirs, ours = tmp_path / f"theirs{ending}", tmp_path / f"ours{ending.upper()}"
    run(*command.split(), "-o", str(theirs), cwd=tmp_path)
    ours.write_text("old")
    COMMANDS[command]().save(ours)
    assert ours.read_bytes() == theirs.read_bytes()


def test_a_trace_has_the_bytes_that_the_command_writes(run: Run, tmp_path: Path) -> None:
    run("circle-test", "paper-4ms", "--trace", "theirs.csv", "--every", "1000", cwd=tmp_path)
    ours = "".join(busplan.circle_test("paper-4ms").trace_csv(every=1000))
    assert ours.encode() == (tmp_path / "theirs.csv").read_bytes()


@pytest.mark.parametrize("name", ["timeline", "circle_test"])
def test_a_note_stands_in_the_title_of_a_picture(name: str) -> None:
    answer = getattr(busplan, name)("paper-4ms")
    assert "With two hubs." not in answer.svg()
    assert "With two hubs." in answer.svg(note="With two hubs.")


def test_what_fails_leaves_the_old_file_whole_and_nothing_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer, target = busplan.latency("paper-4ms"), tmp_path / "old.md"
    target.write_text("old")
    target.chmod(0o640)
    with monkeypatch.context() as broken:
        broken.setattr("os.fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left on device")))
        with pytest.raises(busplan.BusplanError, match=r"old\.md: cannot be written: No space left on device"):
            answer.save(target)
    assert ([one.name for one in tmp_path.iterdir()], target.read_text()) == (["old.md"], "old")
    link = tmp_path / "link.md"
    link.symlink_to(target)
    answer.save(link)
    assert link.is_symlink()
    assert target.read_text().startswith("### Latency of")
    assert target.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(("library", "ending"), [("resvg_py", ".png"), ("pyarrow", ".parquet")])
def test_a_library_that_is_missing_is_named_with_its_extra(
    library: str, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("busplan.extras.find_spec", lambda _: None)
    answer = busplan.timeline("paper-4ms") if ending == ".png" else busplan.sweep("paper-4ms", vary={"bus.nodes": "1"})
    with pytest.raises(busplan.BusplanError, match=rf"x{ending} needs {library}: install it with the extra"):
        answer.save(tmp_path / f"x{ending}")
    assert not list(tmp_path.iterdir())
