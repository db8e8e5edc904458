"""`busplan check`, `rule` and `schema` as they are typed: exit codes, streams, files, and what other programs read."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[2]
CLEAN = (ROOT / "tests/gate/examples/BP001/valid.toml").read_text(encoding="utf-8")
WARNS = CLEAN.replace('"optimal"', "63")
FAILS = CLEAN.replace("period_us = 4000", "period_us = 300")
BROKEN = CLEAN.replace("nodes = 2", "nodes = ")
FORMATS = ("concise", "full", "json", "github", "gitlab", "junit", "sarif", "markdown")

Run = subprocess.CompletedProcess[str]
Busplan = Callable[..., Run]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "p").mkdir()
    for name, text in (("clean", CLEAN), ("fails", FAILS), ("warns", WARNS)):
        (tmp_path / "p" / f"{name}.toml").write_text(text, encoding="utf-8")
    (tmp_path / "p" / "other.toml").write_text("[project]\n", encoding="utf-8")
    return tmp_path


# Exit codes and streams


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["p/clean.toml", "--fail-on", "warning"], 0),
        (["p/warns.toml"], 0),
        (["p/warns.toml", "--fail-on", "warning"], 1),
        (["p/warns.toml", "--fail-on", "warning", "--exit-zero"], 0),
        (["p/fails.toml"], 1),
        (["p/fails.toml", "--exit-zero"], 0),
        (["paper-4ms", "--no-circle"], 0),
        (["p", "gone.toml", "--exit-zero"], 2),
        ([], 2),
        (["p", "--jobs", "0"], 2),
        (["p", "--fail-on", "info"], 2),
        (["p", "--update-baseline"], 2),
        (["p", "--baseline", "gone.json"], 2),
        (["p", "-o", "no/where.txt"], 2),
        (["p", "-o", "p"], 2),
    ],
)
def test_exit_codes(busplan: Busplan, folder: Path, arguments: list[str], code: int) -> None:
    run = busplan("check", *arguments, cwd=folder)
    assert run.returncode == code, run.stderr
    assert "Traceback" not in run.stderr
    assert "itself failed" not in run.stderr
    assert code == 0 or run.stdout or run.stderr


def test_findings_go_to_stdout_and_the_summary_to_stderr(busplan: Busplan, folder: Path) -> None:
    run = busplan("check", "p", cwd=folder)
    assert [line.partition(" ")[0] for line in run.stdout.splitlines()] == ["p/fails.toml:12:1:", "p/warns.toml:7:1:"]
    assert run.stdout.splitlines()[0].startswith("p/fails.toml:12:1: BP101 error: cycle.period_us: the cycle needs ")
    assert run.stderr == "checked 3 profiles: 1 error, 1 warning\n"
    clean = busplan("check", "p/clean.toml", cwd=folder)
    assert (clean.stdout, clean.stderr) == ("", "checked 1 profile: 0 errors, 0 warnings\n")


def test_one_broken_file_does_not_stop_the_others(busplan: Busplan, folder: Path) -> None:
    (folder / "p" / "broken.toml").write_text(BROKEN, encoding="utf-8")
    (folder / "p" / "bytes.toml").write_bytes(b"schema_version = 1\n\xff\n")
    os.mkfifo(folder / "pipe.toml")
    given = ["gone.toml", "p", "pipe.toml", "none"]
    (folder / "none").mkdir()
    run = busplan("check", *given, cwd=folder)
    assert run.returncode == 2
    assert [re.match(r"p/(\w+)\.toml:\d+:\d+: (BP\d+) ", line).groups() for line in run.stdout.splitlines()] == [  # type: ignore[union-attr]
        ("broken", "BP001"),
        ("bytes", "BP001"),
        ("fails", "BP101"),
        ("warns", "BP110"),
    ]
    said = run.stderr.splitlines()
    assert [line.partition(": ")[0] for line in said[:3]] == ["gone.toml", "pipe.toml", "none"]
    assert "no such file" in said[0]
    assert "is a named pipe" in said[1]
    assert "no profile below this folder" in said[2]
    assert said[3:] == ["checked 5 profiles: 3 errors, 1 warning; 3 could not be checked"]
    for one in json.loads(busplan("check", *given, "--format", "json", cwd=folder).stdout)["files"]:
        assert (one["status"] == "error") == (one["path"] in ("gone.toml", "pipe.toml", "none"))
        assert ("failure" in one) == (one["status"] == "error")


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="no file here that root cannot read")
def test_a_file_that_fails_while_it_is_read_is_a_failure(busplan: Busplan, folder: Path) -> None:
    run = busplan("check", "/proc/self/mem", "p/fails.toml", cwd=folder)
    assert (run.returncode, run.stdout[:14]) == (2, "p/fails.toml:1")
    assert run.stderr.startswith("/proc/self/mem: cannot be read: ")


def test_quiet_keeps_failures_and_nothing_else(busplan: Busplan, folder: Path) -> None:
    assert busplan("check", "p", "-q", cwd=folder).stderr == ""
    assert busplan("check", "p", "-q", "--baseline", "b.json", "--update-baseline", cwd=folder).stderr == ""
    run = busplan("check", "p", "gone.toml", "--quiet", cwd=folder)
    assert (run.returncode, len(run.stderr.splitlines())) == (2, 1)
    assert "gone.toml: no such file" in run.stderr


def test_standard_input(busplan: Busplan, folder: Path) -> None:
    run = busplan("check", "-", cwd=folder, stdin=FAILS)
    assert (run.returncode, run.stdout[:15]) == (1, "<stdin>:12:1: B")
    run = busplan("check", "-", "--stdin-filename", "p/a b.toml", cwd=folder, stdin=FAILS)
    assert (run.returncode, run.stdout[:17]) == (1, "p/a b.toml:12:1: ")
    assert busplan("check", "-", cwd=folder, stdin=CLEAN).returncode == 0
    assert busplan("check", "-", cwd=folder, stdin="").returncode == 1


def test_a_shells_process_substitution_is_read(run: Busplan, folder: Path) -> None:
    script = f"{sys.executable} -m busplan check <(sleep 0.2; cat p/fails.toml) -q --no-circle"
    done = run(program=("bash", "-c", script), cwd=folder)
    assert done.returncode == 1, done.stderr
    assert re.match(r"/dev/fd/\d+:12:1: BP101 ", done.stdout)


def test_an_output_file_is_the_report_and_stdout_is_empty(busplan: Busplan, folder: Path) -> None:
    for format_ in FORMATS:
        shown = busplan("check", "p/fails.toml", "--format", format_, cwd=folder)
        written = busplan("check", "p/fails.toml", "--format", format_, "-o", "report.out", cwd=folder)
        assert (written.returncode, written.stdout, written.stderr) == (1, "", shown.stderr)
        assert (folder / "report.out").read_text(encoding="utf-8") == shown.stdout
    assert sorted(path.name for path in folder.iterdir()) == ["p", "report.out"]


def test_the_environment_sets_the_default_format(busplan: Busplan, folder: Path) -> None:
    def call(*arguments: str, form: str) -> Run:
        return busplan(*arguments, cwd=folder, variables={"BUSPLAN_FORMAT": form})

    assert json.loads(call("check", "p", form="json").stdout)["command"] == "check"
    text = call("check", "p", "--format", "concise", form="json").stdout
    assert text == busplan("check", "p", cwd=folder).stdout == call("check", "p", form="").stdout
    run = call("check", "p", form="yaml")
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("BUSPLAN_FORMAT=yaml: expected concise, ")
    # It is this command's: others have formats of their own.
    assert call("rule", form="yaml").returncode == 0


def test_github_has_the_plain_report_on_stderr(busplan: Busplan, folder: Path) -> None:
    plain = busplan("check", "p", cwd=folder)
    run = busplan("check", "p", "--format", "github", cwd=folder)
    assert run.stdout.splitlines()[0].startswith("::error file=p/fails.toml,line=12,col=1,title=BP101 slice-overrun::")
    assert run.stderr == plain.stdout + plain.stderr
    assert busplan("check", "p", "--format", "github", "-q", cwd=folder).stderr == plain.stdout


@pytest.mark.slow
def test_any_number_of_jobs_gives_the_same_bytes(busplan: Busplan, run: Busplan, folder: Path) -> None:
    circle = CLEAN + "[servo]\nposition_gain_per_s = 30000\n"
    for name, text in (("circle", circle), ("broken", BROKEN), ("held", CLEAN)):
        (folder / "p" / f"{name}.toml").write_text(text, encoding="utf-8")
    busplan("check", "p/held.toml", "--baseline", "b.json", "--update-baseline", cwd=folder)
    (folder / "p" / "held.toml").write_text(CLEAN.replace("axes = 4", "axes = 3"), encoding="utf-8")
    given = ("check", "p/clean.toml", "gone.toml", "-", "p", "paper-1ms", "--baseline", "b.json", "--pass-on-unmatched")
    for form, jobs in (("json", "2"), ("full", "3")):  # they show all that a worker tells of a file
        one = busplan(*given, "--format", form, "--jobs", 1, cwd=folder, stdin=FAILS)
        many = run(*given, "--format", form, "--jobs", jobs, cwd=folder, stdin=FAILS, env={})
        assert one.returncode == many.returncode == 2
        assert (one.stdout, one.stderr) == (many.stdout, many.stderr)
    assert {"BP202", "BP301", "<stdin>:12:1:"} <= {*one.stdout.split()}


def test_the_circle_can_be_left_out(busplan: Busplan, folder: Path) -> None:
    (folder / "circle.toml").write_text(CLEAN + "[servo]\nposition_gain_per_s = 30000\n", encoding="utf-8")
    assert busplan("check", "circle.toml", cwd=folder).returncode == 1
    assert busplan("check", "circle.toml", "--no-circle", cwd=folder).returncode == 0
    # A circle that is left out for its length is a warning.
    short = busplan("check", "circle.toml", "--circle-steps", "1000", cwd=folder)
    assert (short.returncode, short.stdout.count("BP204"), short.stdout.count("BP201")) == (0, 1, 0)
    assert "over the limit of 1,000" in short.stdout
    both = busplan("check", "circle.toml", "--circle-steps", "1000", "--no-circle", cwd=folder)
    assert (both.returncode, both.stdout) == (2, "")
    assert "--circle-steps: needs --circle" in both.stderr


# Baseline


def test_a_baseline_is_recorded_and_held(busplan: Busplan, folder: Path) -> None:
    recorded = busplan("check", "p", "--baseline", "b.json", "--update-baseline", cwd=folder)
    assert recorded.returncode == 0  # what is wrong is said, and recorded
    assert recorded.stderr.splitlines()[0] == "recorded 3 profiles with 2 known findings in b.json"
    assert busplan("check", "p/clean.toml", "--baseline", "b.json", cwd=folder).returncode == 0
    (folder / "p" / "clean.toml").write_text(CLEAN.replace("axes = 4", "axes = 3"), encoding="utf-8")
    for path in ("p/clean.toml", "./p/clean.toml", folder / "p" / "clean.toml"):
        run = busplan("check", path, "--baseline", "b.json", cwd=folder)
        assert run.returncode == 1
        # 12 nodes are shown to fit: 48 axes, of three each 36.
        said = "p/clean.toml:19:1: BP301 error: node.axes: 3, was 4: safe axes fell from 56 to 42, "
        assert run.stdout.startswith(said)
        assert len(run.stdout.splitlines()) == 1
    assert busplan("check", "p/clean.toml", "--baseline", "b.json", "--update-baseline", cwd=folder).returncode == 0
    assert busplan("check", "p/clean.toml", "--baseline", "b.json", cwd=folder).returncode == 0


def test_an_update_keeps_what_was_not_checked(busplan: Busplan, folder: Path) -> None:
    busplan("check", "p", "--baseline", "b.json", "--update-baseline", cwd=folder)
    before = json.loads((folder / "b.json").read_text(encoding="utf-8"))["profiles"]
    (folder / "p" / "clean.toml").write_text(CLEAN.replace("axes = 4", "axes = 3"), encoding="utf-8")
    (folder / "p" / "warns.toml").write_text(BROKEN, encoding="utf-8")
    (folder / "p" / "new.toml").write_text(CLEAN, encoding="utf-8")
    given = ["p/clean.toml", "p/warns.toml", "p/new.toml", "gone.toml"]
    assert busplan("check", *given, "--baseline", "b.json", "--update-baseline", cwd=folder).returncode == 2
    after = json.loads((folder / "b.json").read_text(encoding="utf-8"))["profiles"]
    assert list(after) == ["p/clean.toml", "p/fails.toml", "p/new.toml", "p/warns.toml"]
    assert after["p/clean.toml"] != before["p/clean.toml"]
    assert after["p/warns.toml"] == before["p/warns.toml"]
    assert after["p/fails.toml"] == before["p/fails.toml"]


def test_a_baseline_of_other_timing_models_is_recorded_again_as_a_whole(busplan: Busplan, folder: Path) -> None:
    names = ("p/clean.toml", "p/fails.toml", "p/gone.toml", "p/warns.toml")
    older = {"schema": 1, "command": "baseline", "profiles": {key: {"standard.max_axes": 520} for key in names}}
    (folder / "b.json").write_text(json.dumps(older), encoding="utf-8")
    for more in ([], ["--exit-zero", "--quiet", "--pass-on-unmatched", "--format", "json"]):
        run = busplan("check", "p/clean.toml", "--baseline", "b.json", *more, cwd=folder)
        assert (run.returncode, run.stdout) == (2, "")
        assert run.stderr == (
            "b.json: recorded by other timing models, so its figures cannot be compared; record it again with "
            "--update-baseline\n"
        )
    given = ("check", "p/clean.toml", "p/warns.toml", "--baseline", "b.json", "--update-baseline", "--quiet")
    run = busplan(*given, cwd=folder)
    assert (run.returncode, run.stderr.splitlines()) == (
        0,
        [
            "warning: b.json: dropped p/gone.toml: no such profile any more",
            "warning: b.json: dropped p/fails.toml, recorded by other timing models; check them, too",
        ],
    )
    document = json.loads((folder / "b.json").read_text(encoding="utf-8"))
    assert (document["models"], list(document["profiles"])) == (2, ["p/clean.toml", "p/warns.toml"])


CURE = "; use --update-baseline to add or drop these records, or --pass-on-unmatched to accept them\n"


def test_a_baseline_holds_from_every_folder(busplan: Busplan, folder: Path) -> None:
    busplan("check", "p", "--baseline", "p/b.json", "--update-baseline", cwd=folder)
    recorded = json.loads((folder / "p" / "b.json").read_text(encoding="utf-8"))["profiles"]
    assert list(recorded) == ["clean.toml", "fails.toml", "warns.toml"]
    (folder / "p" / "clean.toml").write_text(CLEAN.replace("axes = 4", "axes = 3"), encoding="utf-8")
    (folder / "elsewhere").mkdir()
    (folder / "link").symlink_to("p")
    link = str(folder / "link" / "b.json")
    for cwd, path, baseline in (
        (folder, "p/clean.toml", "p/b.json"),
        (folder / "p", "clean.toml", "b.json"),
        (folder / "p", "../p/clean.toml", "../p/b.json"),
        (folder / "elsewhere", "../p/clean.toml", folder / "p" / "b.json"),
        (folder / "elsewhere", "../link/clean.toml", link),
        (Path("/"), str(folder / "p" / "clean.toml"), link),
    ):
        run = busplan("check", path, "--baseline", baseline, cwd=cwd)
        assert (run.returncode, run.stdout.count("BP301")) == (1, 1), (cwd, path, run)
    text = (folder / "p" / "clean.toml").read_text(encoding="utf-8")
    given = ("check", "-", "--baseline", "p/b.json", "--stdin-filename", "p/clean.toml")
    assert busplan(*given, cwd=folder, stdin=text).stdout.count("BP301") == 1


def test_a_baseline_that_compares_nothing_fails(busplan: Busplan, folder: Path) -> None:
    # An empty one; and a shipped profile has no record in it either.
    (folder / "b.json").write_text('{"schema": 1, "command": "baseline", "models": 2, "profiles": {}}')
    given = ("check", "p/clean.toml", "paper-4ms", "--no-circle", "--baseline", "b.json")
    run = busplan(*given, cwd=folder)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr == (
        f"b.json: 2 profiles have no record (p/clean.toml, paper-4ms.toml){CURE}"
        "checked 2 profiles: 0 errors, 0 warnings; 1 could not be checked; 1 circle test not run; "
        "1 finding suppressed\n"
    )
    # Asked for, it passes, and is still said.
    for more in ([], ["--quiet"]):
        run = busplan(*given, "--pass-on-unmatched", *more, cwd=folder)
        assert run.returncode == 0
        assert run.stderr.startswith(f"warning: b.json: 2 profiles have no record (p/clean.toml, paper-4ms.toml){CURE}")
    assert busplan(*given, "--update-baseline", cwd=folder).returncode == 0
    assert busplan(*given, cwd=folder).returncode == 0
    said = "checked 2 profiles: 0 errors, 0 warnings; 1 circle test not run; 1 finding suppressed\n"
    assert busplan(*given, cwd=folder).stderr == said


def test_a_renamed_profile_is_one_without_a_record_and_a_record_without_one(busplan: Busplan, folder: Path) -> None:
    busplan("check", "p", "--baseline", "b.json", "--update-baseline", cwd=folder)
    (folder / "p" / "clean.toml").rename(folder / "p" / "new.toml")
    (folder / "p" / "warns.toml").write_text("[project]\n", encoding="utf-8")  # no profile any more
    words = (
        f"b.json: 1 profile has no record (p/new.toml), 2 records have no profile (p/clean.toml, p/warns.toml){CURE}"
    )
    for form in (None, "json", "sarif", "junit", "github", "markdown"):
        run = busplan("check", "p/new.toml", "--baseline", "b.json", *(["--format", form] if form else []), cwd=folder)
        assert run.returncode == 2
        assert run.stderr.startswith(words)
        if form in ("json", "sarif", "junit", "markdown"):
            assert "2 records have no profile" in run.stdout
    # What is there and was not checked is no matter: a hook checks what is committed.
    given = ("check", "p/fails.toml", "--baseline", "b.json", "--pass-on-unmatched")
    assert busplan(*given, cwd=folder).returncode == 0
    run = busplan("check", "p", "--baseline", "b.json", "--update-baseline", cwd=folder)
    assert "warning: b.json: dropped p/clean.toml, p/warns.toml: no such profile any more" in run.stderr
    assert busplan("check", "p/new.toml", "--baseline", "b.json", cwd=folder).returncode == 0


MESSAGES = """\
schema_version = 1
name = "car"
bus = { kind = "can", bit_rate_kbit_s = 500 }
message = [{ name = "speed", identifier = 100, payload_bytes = 8, period_us = 10000 }]
"""


def test_a_network_of_messages_is_held_by_its_load(busplan: Busplan, tmp_path: Path) -> None:
    (tmp_path / "car.toml").write_text(MESSAGES, encoding="utf-8")
    given = ("check", "car.toml", "--baseline", "b.json")
    assert busplan(*given, "--update-baseline", cwd=tmp_path).stderr.startswith("recorded 1 profile in b.json\n")
    assert busplan(*given, cwd=tmp_path).returncode == 0
    (tmp_path / "car.toml").write_text(MESSAGES.replace("10000", "5000"), encoding="utf-8")
    run = busplan(*given, cwd=tmp_path)
    assert run.returncode == 1
    # 135 bits with every stuff bit, of 500 kbit/s: 0.27 ms of 10 ms, and of 5 ms.
    assert "BP301 error: message.speed.period_us: 5000, was 10000: bus load rose from 2.7 to 5.4 %" in run.stdout
    (tmp_path / "car.toml").write_text(MESSAGES.replace("10000", "20000"), encoding="utf-8")
    assert busplan(*given, cwd=tmp_path).returncode == 0


def test_what_is_no_baseline_is_never_overwritten(busplan: Busplan, folder: Path) -> None:
    other_models = '{"schema": 1, "command": "baseline", "models": "2", "profiles": {}}'
    for content in ("{", other_models, '{"schema": 2, "command": "baseline", "profiles": {}}', "[project]\n"):
        (folder / "b.json").write_text(content, encoding="utf-8")
        for more in ([], ["--update-baseline"]):
            run = busplan("check", "p", "--baseline", "b.json", *more, cwd=folder)
            assert (run.returncode, run.stdout) == (2, "")
            assert "remove it, and record one with --update-baseline" in run.stderr
        assert (folder / "b.json").read_text(encoding="utf-8") == content


# rule and schema


def test_rule_lists_and_explains(busplan: Busplan, tmp_path: Path) -> None:
    listed = busplan("rule", cwd=tmp_path).stdout
    codes = re.findall(r"^(BP\d+) ", listed, re.MULTILINE)
    assert len(set(codes)) == len(codes) > 30
    rules = json.loads(busplan("rule", "--format", "json", cwd=tmp_path).stdout)["rules"]
    assert [rule["code"] for rule in rules] == codes
    (one,) = json.loads(busplan("rule", "bp110", "--format", "json", cwd=tmp_path).stdout)["rules"]
    assert one in rules
    page = busplan("rule", "BP110", cwd=tmp_path).stdout
    assert page.startswith("BP110 gap-count-wasteful (warning): ")
    assert "# busplan: ignore[BP110] reason" in page
    assert "cannot be suppressed" in busplan("rule", "BP001", cwd=tmp_path).stdout
    unknown = busplan("rule", "BP999", cwd=tmp_path)
    assert (unknown.returncode, unknown.stdout) == (2, "")
    assert unknown.stderr.endswith("`busplan rule` lists them\n")


def test_the_committed_schema_is_what_the_program_prints(busplan: Busplan, tmp_path: Path) -> None:
    run = busplan("schema", cwd=tmp_path)
    assert run.returncode == 0
    assert run.stdout == (ROOT / "profiles" / "busplan.schema.json").read_text(encoding="utf-8"), (
        "run: busplan schema > profiles/busplan.schema.json"
    )


def test_shipped_profiles_name_their_schema_and_are_clean(busplan: Busplan) -> None:
    profiles = sorted((ROOT / "profiles").glob("*.toml"))
    assert profiles
    for path in profiles:
        with path.open(encoding="utf-8") as file:
            assert file.readline() == "#:schema ./busplan.schema.json\n"
    run = busplan("check", "profiles", "--fail-on", "warning", "--jobs", "1", cwd=ROOT)
    assert (run.returncode, run.stdout) == (0, ""), run.stdout
    assert re.fullmatch(
        rf"checked {len(profiles)} profiles: 0 errors, 0 warnings; \d+ findings suppressed\n", run.stderr
    )


# Shell completion, by the protocol of the scripts that `--show-completion` prints


def test_completion_of_names_codes_and_values(busplan: Busplan, tmp_path: Path) -> None:
    def completed(line: str) -> list[str]:
        words = str(len(line.split(" ")) - 1)
        asked = {"_BUSPLAN_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": words}
        run = busplan(cwd=tmp_path, variables=asked)
        assert run.returncode == 0, run.stderr
        return run.stdout.split()

    assert completed("busplan check paper-") == [
        "paper-1ms", "paper-4ms", "paper-dma", "paper-optimal-gap", "paper-two-node",
    ]  # fmt: skip
    assert completed("busplan check paper-4ms paper-1") == ["paper-1ms"]
    assert completed("busplan rule BP11") == ["BP110", "BP111", "BP112", "BP113", "BP114", "BP115"]
    assert completed("busplan explain paper-4ms safe_r") == ["safe_required_us"]
    assert completed("busplan check --format s") == ["sarif"]
    assert completed("busplan check --fail-on ") == ["error", "warning"]
    # Nothing of ours: the shell goes on to files.
    assert completed("busplan check ./pro") == []


# What others run


def parsed(name: str) -> Any:
    return YAML(typ="safe").load((ROOT / name).read_text(encoding="utf-8"))


def put_program(program: Path, folder: Path) -> None:
    """Put the program into the folder where the runner's first steps have installed it."""
    folder.mkdir(parents=True)
    (folder / "busplan").symlink_to(program)


@pytest.mark.slow
def test_the_pre_commit_hook_checks_profiles_wherever_they_are_and_nothing_else(
    run: Busplan, program: Path, folder: Path
) -> None:
    (hook,) = parsed(".pre-commit-hooks.yaml")
    assert {"id", "name", "entry", "language"} <= set(hook)
    # Warnings fail nothing, and pre-commit shows what passes only where it is verbose.
    assert (hook["language"], hook["types"], hook["verbose"]) == ("python", ["toml"], True)
    assert not {"files", "exclude"} & set(hook)
    repository = folder / "repository"
    shutil.copytree(folder / "p", repository / "machine" / "line-2")
    for name in ("pyproject.toml", "other/profiles.toml"):
        (repository / name).parent.mkdir(exist_ok=True)
        (repository / name).write_text("[project]\n", encoding="utf-8")
    option = "--stdin-filename=x/fails.toml"
    (repository / option).parent.mkdir(parents=True)
    shutil.copy(repository / "machine" / "line-2" / "fails.toml", repository / option)
    # As pre-commit does: files by their type, many of them in one call from the top of the repository.
    everything = sorted(path.relative_to(repository).as_posix() for path in repository.rglob("*.toml"))
    hooked = partial(
        run,
        program=(*hook["entry"].split(), *hook["args"]),
        cwd=repository,
        env={"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"},
    )
    failed = hooked(*everything)
    assert failed.returncode == 1
    assert [line.partition(" error:")[0] for line in failed.stdout.splitlines() if " error:" in line] == [
        f"{option}:12:1: BP101",
        "machine/line-2/fails.toml:12:1: BP101",
    ]
    assert "machine/line-2/warns.toml:7:1: BP110 warning: " in failed.stdout
    assert failed.stderr == ("checked 4 profiles: 2 errors, 1 warning; skipped 3 files without a schema_version\n")
    passed = hooked("pyproject.toml", "machine/line-2/warns.toml")
    assert (passed.returncode, passed.stdout.count("BP110 warning")) == (0, 1)
    nothing = hooked("pyproject.toml")
    assert (nothing.returncode, nothing.stdout) == (0, "")
    assert nothing.stderr == "checked 0 profiles: 0 errors, 0 warnings; skipped 1 file without a schema_version\n"


def test_others_are_skipped_on_request_alone(busplan: Busplan, folder: Path) -> None:
    given = ["p/other.toml", "p/clean.toml"]
    assert busplan("check", *given, cwd=folder).returncode == 1
    run = busplan("check", *given, "--skip-others", "-v", cwd=folder)
    assert run.returncode == 0
    assert run.stderr.splitlines() == [
        "p/other.toml: skipped, claims no schema_version",
        "p/clean.toml: ok",
        (
            "p/clean.toml: rests on an instant host, cycles without jitter, no busy retries, PHYs of 14 ticks, "
            "a chain of cables, no slower execution, no other traffic"
        ),
        "checked 1 profile: 0 errors, 0 warnings; skipped 1 file without a schema_version",
    ]
    # A broken profile is one still, and what is not there is no other file.
    (folder / "p" / "broken.toml").write_text(BROKEN, encoding="utf-8")
    assert busplan("check", "p/broken.toml", "--skip-others", cwd=folder).returncode == 1
    assert busplan("check", "gone.toml", "--skip-others", cwd=folder).returncode == 2
    # Each is counted once.
    run = busplan("check", "p", "p/other.toml", "--skip-others", "--no-circle", cwd=folder)
    assert run.stderr.endswith("; skipped 1 file without a schema_version\n")


# What a terminal shows


def test_a_terminal_has_the_full_form_and_a_pipe_one_line_a_finding(
    busplan: Busplan, on_terminal: Callable[..., tuple[int, str]], folder: Path
) -> None:
    plain = busplan("check", "p/fails.toml", cwd=folder)
    assert plain.stdout == busplan("check", "p/fails.toml", "--format", "concise", cwd=folder).stdout
    code, shown = on_terminal("check", "p/fails.toml", cwd=folder, env={"COLUMNS": "80"})
    assert code == 1
    lines = re.sub(r"\x1b\[[0-9;]*m", "", shown).splitlines()
    assert lines[0].startswith("p/fails.toml:12:1: BP101 error: cycle.period_us: the cycle ")
    assert max(map(len, lines)) <= 80
    assert "12 | period_us = 300" in lines
    assert "   |             ^^^ slice-overrun" in lines
    # The paper's slice of 150 us lacks 57.8 and has to hold the 11.4 of the uncertainty, too: 219.2 of 300.
    assert "    cycle.slice_ratio = 0.69" in lines
    assert "\x1b[" in shown
    # A file is read by a program.
    busplan("check", "p/fails.toml", "-o", "out.txt", cwd=folder)
    assert (folder / "out.txt").read_text(encoding="utf-8") == plain.stdout


INSTALL, CHECK = 1, 2
"""Steps of the action that are ours; the first sets up Python."""
Step = Callable[..., Run]


@pytest.fixture
def action_step(run: Busplan) -> Step:
    """Run one step of the action as the runner does: inputs put in, then bash with its usual flags."""

    def call(number: int, folder: Path, *, path: str = "", temporary: Path | None = None, **inputs: str) -> Run:
        action = parsed("action.yml")
        given = {name: one["default"] for name, one in action["inputs"].items()} | inputs
        step = action["runs"]["steps"][number]
        assert step["shell"] == "bash"
        assert "${{" not in step["run"], "inputs must come by the environment: in the script they could be commands"

        def put_in(text: str) -> str:
            text = text.replace("${{ steps.python.outputs.python-path }}", "python3")
            return re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda match: given[match[1]], text)

        variables = {
            "PATH": f"{path}{os.pathsep}{os.environ['PATH']}",
            "RUNNER_TEMP": str(temporary or folder / "runner temp"),
            "GITHUB_ACTION_PATH": str(ROOT),
            "GITHUB_OUTPUT": str(folder.parent / "output"),
            "GITHUB_STEP_SUMMARY": str(folder.parent / "summary"),
            **{name: put_in(value) for name, value in step.get("env", {}).items()},
        }
        bash = ("bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"])
        return run(program=bash, cwd=folder, env=variables)

    return call


@pytest.mark.slow
@pytest.mark.parametrize(
    ("schema", "files"),
    [
        ("github-actions", "action.yml"),
        ("github-workflows", ".github/workflows/*.yml"),
        ("github-issue-forms", ".github/ISSUE_TEMPLATE/*.yml"),
        ("citation-file-format", "CITATION.cff"),
    ],
)
def test_what_other_programs_read_is_valid(run: Busplan, tmp_path: Path, schema: str, files: str) -> None:
    paths = map(str, ROOT.glob(files))
    done = run("--builtin-schema", f"vendor.{schema}", *paths, python=("-m", "check_jsonschema"), cwd=tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_action_checks_annotates_and_writes_a_summary(action_step: Step, program: Path, folder: Path) -> None:
    put_program(program, folder / "work" / "runner temp" / "busplan" / "bin")
    work = folder / "work"
    (folder / "p").rename(work / "p")

    def check(**inputs: Any) -> tuple[Run, list[str]]:
        for name in ("output", "summary"):
            (folder / name).unlink(missing_ok=True)
        run = action_step(CHECK, work, **inputs)
        return run, (folder / "output").read_text(encoding="utf-8").splitlines()

    run, outputs = check()
    assert (run.returncode, outputs) == (1, ["exit-code=1", "result=fails"])
    assert run.stdout.startswith("::error file=p/fails.toml,line=12,col=1,title=BP101 slice-overrun::")
    assert "p/warns.toml:7:1: BP110" in run.stderr
    summary = (folder / "summary").read_text(encoding="utf-8")
    assert summary.startswith("### Check of profiles\n")
    assert "| `p/clean.toml` | passes | fits |" in summary
    assert "| `p/fails.toml` | **1 error** | does not fit |" in summary
    run, outputs = check(paths="p/clean.toml p/warns.toml", args="--fail-on warning")
    assert (run.returncode, run.stdout[:28], outputs[0]) == (1, "::warning file=p/warns.toml,", "exit-code=1")
    run, outputs = check(paths="gone.toml; touch owned $(touch owned)")
    assert (run.returncode, outputs) == (2, ["exit-code=2", "result=could not check"])
    assert not (work / "owned").exists()
    # A file of the pull request is no report of ours, nor is what it points to written.
    (work / "target").write_text("kept", encoding="utf-8")
    (work / "b.sarif").symlink_to("target")
    assert check(sarif="b.sarif")[1] == ["sarif=b.sarif", "exit-code=1", "result=fails"]
    assert json.loads((work / "b.sarif").read_text(encoding="utf-8"))["version"] == "2.1.0"
    assert (work / "target").read_text(encoding="utf-8") == "kept"
    assert check(sarif="b.sarif", args="--no-such-option")[1] == ["exit-code=2", "result=could not check"]
    assert not (work / "b.sarif").exists()
    # A report of the workflow's own is not written over.
    warns = str(work / "p" / "warns.toml")
    assert check(paths=warns, args="--format json -o own.json")[1] == ["exit-code=0", "result=passes"]
    assert "| `p/warns.toml` | 1 warning | fits |" in (folder / "summary").read_text(encoding="utf-8")
    assert json.loads((work / "own.json").read_text(encoding="utf-8"))["command"] == "check"


HOSTILE_FILES = ("--exit-zero", "--help", "-o", "--baseline=b", "-", "-qv")
"""Names that a pull request may give, each an option of `check` or standard input."""


@pytest.mark.parametrize("paths", ["-* ./*", "* nothing-here"])
def test_no_file_of_a_pull_request_is_an_option_of_the_action(
    action_step: Step, program: Path, folder: Path, paths: str
) -> None:
    put_program(program, folder / "runner temp" / "busplan" / "bin")
    work = folder / "work"
    work.mkdir()
    (folder / "p").rename(work / "p")
    for name in HOSTILE_FILES:
        shutil.copy(work / "p" / "fails.toml", work / name)
    run = action_step(CHECK, work, temporary=folder / "runner temp", paths=paths)
    assert run.returncode == (2 if "nothing-here" in paths else 1), run.stderr
    for name in HOSTILE_FILES:
        assert f"file={name},line=12," in run.stdout
    assert sorted(path.name for path in work.iterdir()) == sorted([*HOSTILE_FILES, "p"])


def test_a_folder_called_like_a_shipped_profile_is_that_folder(action_step: Step, program: Path, folder: Path) -> None:
    put_program(program, folder / "runner temp" / "busplan" / "bin")
    (folder / "p").rename(folder / "paper-1ms")
    # Options are the workflow's own, and no wildcards.
    run = action_step(CHECK, folder, paths="paper-1ms", args="--exit-zero")
    assert run.returncode == 0
    assert "file=paper-1ms/fails.toml,line=12," in run.stdout
    assert action_step(CHECK, folder, paths="paper-1ms", args="--baseline *").returncode == 2


def test_the_action_installs_into_a_folder_of_its_own(action_step: Step, folder: Path) -> None:
    # The install itself takes a network and half a minute: here a python3 that writes down what it is asked for.
    stub = folder / "stub"
    stub.mkdir()
    (stub / "python3").write_text(
        '#!/bin/bash\nprintf "%s\\n" "$@" >> log\n'
        'if [ "$3" = venv ]; then mkdir -p "$4/bin"; cp "$0" "$4/bin/python"; fi\n',
        encoding="utf-8",
    )
    (stub / "python3").chmod(0o755)
    run = action_step(INSTALL, folder, path=str(stub))
    assert run.returncode == 0, run.stderr
    temporary = folder / "runner temp" / "busplan"
    assert (folder / "log").read_text(encoding="utf-8").splitlines() == [
        "-I", "-m", "venv", str(temporary), "-I", "-m", "pip", "install", "--quiet", str(ROOT),
    ]  # fmt: skip
    assert (ROOT / "pyproject.toml").is_file()


@pytest.mark.parametrize("content", [b"a = [\n", b""])
def test_a_file_that_is_no_profile_is_a_finding_and_one_that_is_not_there_is_none(
    busplan: Busplan, tmp_path: Path, content: bytes
) -> None:
    # As linters have it: the repository is broken, not the gate. Every other command could not do its job.
    (tmp_path / "a.toml").write_bytes(content)
    assert [busplan(*line, cwd=tmp_path).returncode for line in (("check", "a.toml"), ("check", "b.toml"))] == [1, 2]
    assert busplan("capacity", "a.toml", cwd=tmp_path).returncode == 2
