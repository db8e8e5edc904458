"""`check --recording`: a machine outside its plan is an error, at the key that plans it."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import busplan

if TYPE_CHECKING:
    from subprocess import CompletedProcess

Run = Callable[..., "CompletedProcess[str]"]
CAPTURE = Path(__file__).parents[1] / "questions" / "measured" / "files" / "capture.pcapng"
LOG = Path(__file__).parent / "examples" / "BP401" / "recording.log"


def press(run: Run, folder: Path, old: str = "", new: str = "") -> Path:
    run("init", "press", "--from", "ethercat-servo-8", cwd=folder)
    path = folder / "press.toml"
    path.write_text(path.read_text().replace(old, new))
    return path


def test_a_machine_within_its_plan_passes_and_one_outside_fails(run: Run, tmp_path: Path) -> None:
    words = ("check", "press.toml", "--no-circle", "--recording", str(CAPTURE))
    press(run, tmp_path)
    done = run(*words, cwd=tmp_path)
    assert (done.returncode, "BP401" in done.stdout) == (0, False), done
    path = press(run, tmp_path, "master_jitter_us = 20 ", "master_jitter_us = 11 ")
    done = run(*words, cwd=tmp_path)
    assert done.returncode == 1
    line = next(number for number, text in enumerate(path.read_text().splitlines(), 1) if "master_jitter_us" in text)
    assert f"press.toml:{line}:1: BP401 error: bus.master_jitter_us: latest start: " in done.stdout
    assert " us recorded, at most 11.0 us planned, first at 0.020017 s, frame 41; " in done.stdout
    assert "busplan measured --apply writes what was measured" in done.stdout
    # Half of the cycles keep it.
    assert "BP401" not in run(*words, "--quantile", "0.5", cwd=tmp_path).stdout
    path.write_text(path.read_text().replace("# assumed: of such", "# busplan: ignore[BP401] a test bench; of such"))
    assert run(*words, cwd=tmp_path).returncode == 0
    path.write_text(path.read_text().replace("master_jitter_us = 11 ", "master_jitter_us = 20 "))
    assert "BP902" in run(*words, cwd=tmp_path).stdout
    # Without a recording the comment is not held to be without effect.
    assert "BP902" not in run(*words[:3], cwd=tmp_path).stdout


def test_a_share_and_its_uncertainty_are_in_one_unit(tmp_path: Path) -> None:
    profile = tmp_path / "slow.toml"
    profile.write_text((LOG.parent / "valid.toml").read_text().replace("period_us = 4000", "period_us = 8000"))
    (seen,) = [one for one in busplan.measured(profile, LOG).figures if one.quantity == "load"]
    assert None not in (seen.uncertainty, seen.recorded, seen.planned)
    messages = [one.finding.message for one in busplan.check(profile, recording=LOG).findings]
    (said,) = [message for message in messages if message.startswith("name: load: ")]
    assert f" +/- {100 * (seen.uncertainty or 0.0):.2g} % recorded, " in said
    recorded, planned = (
        float(number) for number in re.findall(r"load: ([\d.]+) .* at most ([\d.]+) % planned", said)[0]
    )
    assert (recorded, planned) == pytest.approx(
        tuple(100 * (share or 0.0) for share in (seen.recorded, seen.planned)), rel=0.01
    )


def test_what_no_key_plans_is_at_the_name(tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text(LOG.read_text() + "(1700000001.000000) can0 7AA#00\n")
    answer = busplan.check(LOG.parent / "valid.toml", recording=log)
    (file,) = answer.files
    (finding,) = file.findings
    number = len(log.read_text().splitlines())
    words = f"1 recorded, at most 0 planned, first at 0.999952 s, frame {number} (0x7aa)"
    assert finding.message == f"name: frames of no message of the plan: {words}"
    assert (finding.line, finding.column) == (2, 1)


def test_what_cannot_be_compared_is_no_finding(run: Run, tmp_path: Path) -> None:
    press(run, tmp_path)
    done = run("check", "press.toml", "--recording", str(LOG), cwd=tmp_path)
    assert done.returncode == 2
    assert "recording.log: is not a pcap or pcapng file" in done.stderr
    done = run("check", "press.toml", "--recording", "gone.pcap", cwd=tmp_path)
    assert (done.returncode, "gone.pcap: cannot be read" in done.stderr) == (2, True)
    done = run("check", "press.toml", "paper-4ms", "--recording", str(CAPTURE), cwd=tmp_path)
    assert done.returncode == 2
    assert "needs exactly one profile, that of its machine" in done.stderr
    done = run("check", "press.toml", "--quantile", "0.9", cwd=tmp_path)
    assert (done.returncode, "--quantile: needs --recording FILE" in done.stderr) == (2, True)
    done = run("check", "press.toml", "--recording", str(CAPTURE), "--quantile", "7", cwd=tmp_path)
    assert (done.returncode, "quantile 7: expected a share of 0.5 to 1" in done.stderr) == (2, True)
    (tmp_path / "own.pcapng").write_bytes(CAPTURE.read_bytes())
    done = run("check", "press.toml", "--recording", "own.pcapng", "-o", "own.pcapng", cwd=tmp_path)
    assert done.returncode == 2
    assert (tmp_path / "own.pcapng").read_bytes() == CAPTURE.read_bytes()
    # A profile in memory is one, too.
    car = busplan.load_profile(LOG.parent / "valid.toml")
    assert busplan.check(car, recording=LOG).findings == ()
    several: tuple[list[busplan.Profile | str], ...] = (["paper-4ms", "paper-dma"], [car, car], [car, "paper-4ms"])
    for profiles in several:
        with pytest.raises(busplan.BusplanError, match="needs exactly one profile"):
            busplan.check(profiles, recording=CAPTURE)
