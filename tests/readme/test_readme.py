"""The README and the manual say what the program does: output blocks, tables, keys and links are checked."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import pytest
from typer.testing import CliRunner

import busplan
from busplan.buses import kind_named, kind_names
from busplan.cli import app
from busplan.manual import FOLDER, page, topics
from busplan.manual.tables import made_table
from busplan.profile.document import decode, validate
from busplan.profile.sources import load
from busplan.questions.explain.derivation import constant_rows, figures_of
from tests.registers import COMMANDS

Run = Callable[..., CompletedProcess[str]]

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
PAGES = {path: path.read_text(encoding="utf-8") for path in (README, *sorted(FOLDER.glob("*.md")))}
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
MAX_WIDTH = 130
MOST_README_BYTES = 8_192
GALLERY = FOLDER / "commands.md"
MOST_PICTURE_BYTES = 150_000
"""They ship with the package."""


SHOWN_FIRST = "ieee1394"
"""The kind whose keys and figures the pages show; the page of a further kind shows what keys it has beside them."""


@pytest.fixture(autouse=True)
def one_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """No worker processes: their start takes longer than any example, and their rows are the same."""
    monkeypatch.setattr("busplan.cli.workers.available_processors", lambda: 1)


def shown_runs() -> Iterator[tuple[str, str]]:
    """Each `$ busplan ...` of all pages with the output printed below it."""
    for block in (one for text in PAGES.values() for one in CONSOLE.findall(text)):
        for run in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = run.partition("\n")
            if command.startswith("busplan"):
                yield command, output


@pytest.mark.parametrize(("command", "output"), list(shown_runs()), ids=lambda text: text[:40])
def test_output_blocks_are_the_programs_own(shell: Run, command: str, output: str, tmp_path: Path) -> None:
    run = shell(command, cwd=tmp_path)
    assert run.stdout + run.stderr == output


def pictures() -> dict[str, str]:
    """The command that draws each picture of the gallery, by the picture's file name."""
    commands = re.findall(r"^(busplan .* (\S+\.svg))$", PAGES[GALLERY], re.MULTILINE)
    return {name: command for command, name in commands}


def test_the_readme_is_short_and_shows_a_picture_of_the_gallery() -> None:
    assert len(PAGES[README].encode()) <= MOST_README_BYTES
    (picture,) = re.findall(r'<img src="([^"]+)"', PAGES[README])
    assert (ROOT / picture).parent == FOLDER
    assert f"`{pictures()[Path(picture).name]}`" in PAGES[README]


@pytest.mark.parametrize(("name", "command"), pictures().items())
def test_a_picture_is_what_its_command_draws(shell: Run, name: str, command: str, tmp_path: Path) -> None:
    shell(command, cwd=tmp_path)
    assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes()


def test_the_gallery_shows_every_picture_in_words_too_and_all_are_small() -> None:
    shown = re.findall(r'^<img src="(\S+)" width="100%" alt="[^"]{20,}">$', PAGES[GALLERY], re.MULTILINE)
    assert shown == list(pictures())
    assert sorted(shown) == sorted(path.name for path in FOLDER.glob("*.svg"))
    assert sum((FOLDER / name).stat().st_size for name in shown) <= MOST_PICTURE_BYTES


@pytest.mark.slow
def test_the_commands_for_a_machine_run_as_they_stand(shell: Run, tmp_path: Path) -> None:
    section = PAGES[README].partition("\n## My machine\n")[2]
    commands = re.findall(
        r"^(busplan .*?)(?: +#.*)?$", section.partition("```sh\n")[2].partition("```")[0], re.MULTILINE
    )
    assert len(commands) >= 8
    for command in commands:
        assert shell(command, cwd=tmp_path).returncode == 0, command


def test_the_python_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```$", PAGES[README], re.MULTILINE | re.DOTALL)
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out == "fits 932\n"


def test_there_are_blocks_to_check() -> None:
    commands = {command.split()[1] for command, _ in shown_runs()}
    assert commands >= {"capacity", "latency", "explain", "paper", "init", "rule"}


def schema_keys(schema: dict[str, Any], definitions: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Every key of a JSON Schema that has a value and no further keys."""
    schema = definitions[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema
    for name, inner in schema.get("properties", {}).items():
        yield from list(schema_keys(inner, definitions, f"{prefix}{name}.")) or [f"{prefix}{name}"]
    for inner in filter(None, (*schema.get("anyOf", ()), *schema.get("oneOf", ()), schema.get("items"))):
        yield from schema_keys(inner, definitions, prefix)


NAMED = r"(group|message)\.|servo\.(x|y|grades)\."
"""Keys of a table that a profile has several times, or for each other key: the manual shows a pattern."""


@pytest.mark.parametrize("kind", kind_names())
def test_the_manual_has_each_key_of_the_schema_and_no_other(kind: str) -> None:
    schema = kind_named(kind).profile_model().model_json_schema()
    keys = {key for key in schema_keys(schema, schema["$defs"]) if not re.match(NAMED, key)}
    own, common = ({row.split("`")[1] for row in made_table("keys", of)[2:]} for of in (kind, SHOWN_FIRST))
    assert keys - own - common == set()
    assert {key for key in own if not re.match(NAMED, f"{key}.")} - keys == set()


@pytest.mark.parametrize(
    ("key", "values"),
    {
        "name": "text up to 100 characters, required",
        "bus.speed": "S100, S200, S400, S800, S1600, S3200, required",
        "bus.gap_count": "whole 0 to 63 or optimal (63)",
        "bus.nodes": "whole 1 or more, required without groups",
        "bus.cable_length_m": "over 0, to 100 (4.5)",
        "bus.cycle_master": "true, false (true)",
        "bus.isochronous_us": "0 to 125 (0.0)",
        "node.execution.uncertainty_us": "0 or more",
        "servo.velocity_feedforward": "number (1.0)",
        "servo.grades.KEY": "published, measured, calibrated, assumed",
        "circle.ramp_periods": "whole 0 or more (100)",
        "node.execution.time_us": "list of 0 or more, required",
        "group.NAME.name": "text up to 40 characters of letters, digits, - and _, required",
    }.items(),
)
def test_the_manual_says_what_a_key_may_have(key: str, values: str) -> None:
    assert f"\n| `{key}` | {values} | " in page("profile")


@pytest.mark.parametrize("kind", kind_names())
def test_the_manual_has_the_constants_that_nobody_has_published(kind: str) -> None:
    rows = [row.split(" | ") for row in made_table("constants", kind)[2:]]
    unpublished = [(name, one.grade) for name, one in kind_named(kind).constants.items() if one.grade != "published"]
    assert [(row[0].strip("| `"), row[2]) for row in rows] == unpublished


@pytest.mark.parametrize("topic", topics())
def test_a_page_is_shown_with_the_tables_that_it_asks_for(topic: str) -> None:
    asked = [line for line in PAGES[FOLDER / f"{topic}.md"].splitlines() if " has a table here: " in line]
    assert [line for line in asked if f"`busplan manual {topic}`" not in line] == []
    shown = page(topic)
    assert "has a table here" not in shown
    assert len(re.findall(r"^\| ?:?-", shown, re.MULTILINE)) == len(asked) + len(
        re.findall(r"^\| ?:?-", PAGES[FOLDER / f"{topic}.md"], re.MULTILINE)
    )


def test_the_manual_asks_for_the_keys_and_constants_of_each_kind() -> None:
    for what in ("keys", "constants"):
        assert sorted(re.findall(rf"table here: {what} of `(\w+)`", "".join(PAGES.values()))) == sorted(kind_names())


def test_the_command_that_a_page_names_has_all_constants_and_the_kind_s_own_figures() -> None:
    named = [re.findall(r"`busplan explain (\S+) --format json`", text) for text in PAGES.values()]
    first = figures_of(kind_named(SHOWN_FIRST))
    kinds = []
    for name in (name for names in named for name in names):
        document = json.loads(CliRunner().invoke(app, ["explain", name, "--format", "json"]).stdout)
        kinds.append(load(name).profile.bus.kind)
        assert document["constants"] == constant_rows(kind_named(kinds[-1]))
        listed = {(row["command"], row["figure"]) for row in document["figures"]}
        for command, figures in figures_of(kind_named(kinds[-1])).items():
            assert {(command, key) for key, figure in figures.items() if figure != first[command].get(key)} <= listed
    assert sorted(kinds) == sorted(kind_names())


def test_the_groups_shown_are_those_of_the_shipped_profile() -> None:
    (groups,) = re.findall(r"^```toml\n(.*?)^```$", PAGES[FOLDER / "profile.md"], re.MULTILINE | re.DOTALL)
    above, _, _ = load("gantry-24").document.text.partition("# The groups stand")
    assert [group.name for group in validate(decode(f"{above}{groups}".encode(), name="page")).group] == [
        "drives",
        "io",
    ]


DOCUMENTS = {
    "latency": "paper-4ms",
    "capacity": "paper-1ms --period 600us --sensitivity",
    "circle-test": "paper-4ms --period 4ms --period 100us --contributions",
    "explain": "paper-4ms required_us",
    "report": "paper-4ms --no-circle",
    "check": "paper-optimal-gap nowhere.toml --no-circle",
    "rule": "BP101",
    "diff": "paper-1ms paper-optimal-gap",
    "plan": "paper-1ms --axes 400",
    "sweep": "paper-4ms --vary bus.nodes=1:2 --circle --jobs 1",
    "calibrate": "paper-two-node table-1.csv",
    "measured": f"ethercat-servo-8 {ROOT}/tests/questions/measured/files/capture.pcapng --quantile 0.9",
    "timeline": "paper-4ms",
    "map": "paper-4ms --x axes=4,6",
    "explore": "paper-4ms --x axes=4,6 --y cycle.period_us=500",
    "compare": "paper-4ms",
    "evidence": "ieee1394",
    "paper": "",
    "profiles": "",
}
FREE = {"changes", "smallest_period_with", "measured", "recommended_changes", "varied", "execution", "notes", "answers"}
"""What holds keys of a profile, or others that are not the document's own."""


def keys_of(document: object) -> Iterator[str]:
    """Every key of a document but those of what is free."""
    if isinstance(document, list):
        for one in document:
            yield from keys_of(one)
    elif isinstance(document, dict):
        for key, value in document.items():
            yield key
            if key not in FREE or isinstance(value, list):
                yield from keys_of(value)


def figure_keys() -> str:
    """Keys of figures, which mean the same in every document: those of `explain`, and first cells of the tables."""
    rows = [*made_table("other figures", ""), *made_table("figures", "circle-test")]
    explained = (figure.key for _, figure in busplan.explain("paper-4ms").figures)
    return "".join(row.split("|")[1] for row in rows) + "".join(map("`{}`".format, explained))


def json_section(command: str) -> str:
    """What the page says of a command's document."""
    return PAGES[FOLDER / "json.md"].partition(f"\n### {command}\n")[2].partition("\n### ")[0]


@pytest.mark.slow
@pytest.mark.parametrize("command", DOCUMENTS)
def test_every_json_key_is_listed(command: str) -> None:
    done = CliRunner().invoke(app, [command, *DOCUMENTS[command].split(), "--format", "json"])
    _, _, documents = PAGES[FOLDER / "json.md"].partition("\n## Documents\n")
    everywhere = documents.partition("\n### ")[0] + figure_keys()
    own = json_section(command)
    said = everywhere + own + "".join(json_section(name) for name in re.findall(r"as in `(\w+)`", own))
    keys = set(keys_of(json.loads(done.stdout))) - {"schema", "command", "bus.nodes", "payload.read_bytes"}
    assert len(keys) >= 2 - (command in {"rule", "report"})
    assert [key for key in sorted(keys) if f"`{key}`" not in said] == []


def test_every_command_with_a_document_is_listed() -> None:
    listed = re.findall(r"^### (.*)$", PAGES[FOLDER / "json.md"], re.MULTILINE)
    assert listed == list(DOCUMENTS)
    assert set(COMMANDS) - set(listed) == {"schema", "manual", "init", "import", "emulate"}


def test_every_link_resolves() -> None:
    for path, link in ((path, link) for path, text in PAGES.items() for link in LINK.findall(text)):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        assert target.is_file(), (path, link)
        assert not anchor or anchor in anchors(target.read_text(encoding="utf-8")), (path, link)


def anchors(text: str) -> set[str]:
    """Anchors that GitHub gives the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_readme_links_to_every_topic() -> None:
    assert [topic for topic in topics() if f"(src/busplan/manual/{topic}.md" not in PAGES[README]] == []


def test_a_page_is_plain_ascii_with_one_title_and_short_lines() -> None:
    for topic in topics():
        text = PAGES[FOLDER / f"{topic}.md"]
        assert text.isascii(), topic
        prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
        assert re.findall(r"^# .*$", prose, re.MULTILINE) == [text.splitlines()[0]]
        assert [line for line in prose.splitlines() if len(line) > MAX_WIDTH and not line.startswith("|")] == []
