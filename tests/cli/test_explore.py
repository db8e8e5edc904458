"""`busplan explore`: each setting of the page is that of `capacity`, in every form, and in a browser."""

import json
import re
from base64 import b64encode
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

import busplan
from busplan.forms.blocks import Card
from busplan.forms.numbers import sentence_text
from tests.browser import Tab, browser, needs_chromium

Run = Callable[..., Any]
Refused = Callable[..., str]

PERIODS_US, AXES, SIZES = (300, 500, 1000), (8, 16, 18, 32), (4, 64)
FEW = ("--x", "axes=8,16,18,32", "--y", "cycle.period_us=300,500,1000", "--over", "payload.write_bytes=4,64")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small page; the profile's own payload is none of its values, and 18 axes cannot exist, 4 a node."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    answer = busplan.explore(
        "paper-1ms",
        x={"axes": AXES},
        y={"cycle.period_us": PERIODS_US},
        over={"payload.write_bytes": SIZES},
    )
    answer.save(path)
    return path


def lines_of(period_us: float, axes: int, size: int) -> dict[str, str]:
    """The card of `capacity` at a setting."""
    changes = {"cycle.period_us": period_us, "bus.nodes": axes // 4, "payload.write_bytes": size}
    profile = busplan.load_profile("paper-1ms", changes=changes)
    (card,) = (block for block in busplan.capacity(profile).report().blocks if isinstance(block, Card))
    return {"": card.verdict.text, **{label: sentence_text(words) for label, words in card.lines}}


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [
        ("gantry-24", {"group.drives.nodes": [2, 20]}, {"bus.gap_count": [63, "optimal"]}),
        ("can-servo-8", {"bus.nodes": [3, 40]}, {"cycle.period_us": [4000]}),
    ],
)
def test_the_card_of_a_setting_is_that_of_capacity_of_groups_words_and_searches(
    name: str, x: dict[str, list[int]], y: dict[str, list[int | str]]
) -> None:
    (key_x, values_x), *_ = x.items()
    (key_y, values_y), *_ = y.items()
    own = next(iter(busplan.load_profile(name).node_groups))
    over = {own.payload_key("write"): [own.payload.write_bytes or 4]}
    answer = busplan.explore(name, x=x, y=y, over=over)
    cards = iter(answer.cards[0])
    for value_y in values_y:
        for value_x in values_x:
            changes = {key_x: value_x, key_y: value_y, **{key: sizes[0] for key, sizes in over.items()}}
            profile = busplan.load_profile(name, changes=changes)
            (card,) = (block for block in busplan.capacity(profile).report().blocks if isinstance(block, Card))
            assert next(cards) == card


def settings(
    text: str, *, x: tuple[int, ...] = AXES, y: tuple[int, ...] = PERIODS_US, over: tuple[int, ...] = SIZES
) -> Iterator[tuple[tuple[float, int, int], dict[str, str] | None]]:
    """Each setting of a page with what its script shows there."""
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    table = json.loads(data)
    for size, of_map in zip(over, table["settings"], strict=True):
        places = [(period_us, axes) for period_us in y for axes in x]
        for (period_us, axes), setting in zip(places, of_map, strict=True):
            if setting is None:
                yield (period_us, axes, size), None
                continue
            _, word, _, _, lines = setting
            shown = {table["labels"][label]: table["texts"][words] for label, words, _ in lines}
            yield (period_us, axes, size), {"": table["texts"][word], **shown}


def test_every_setting_is_that_of_capacity(page: Path) -> None:
    seen = dict(settings(page.read_text(encoding="utf-8")))
    assert len(seen) == 24
    assert {place for place, lines in seen.items() if lines is None} == {(p, 18, s) for p in PERIODS_US for s in SIZES}
    for place, lines in seen.items():
        if lines is not None:
            assert lines == lines_of(*place), place
    assert {lines[""] for lines in seen.values() if lines} >= {"FITS", "DOES NOT FIT"}


def test_the_page_allows_its_own_script_alone(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    (script,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in text
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)


def test_names_end_no_element_of_the_page(run: Run, tmp_path: Path) -> None:
    evil = "</script><script>alert(1)</script><!--"
    assert run("explore", "paper-1ms", *FEW, "--set", f'name="{evil}"', "-o", "p.html", cwd=tmp_path).returncode == 0
    text = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert text.count("<script") == text.count("</script>") == 2
    assert "alert(1)</script>" not in text


def test_other_forms_show_the_map_of_this_design(run: Run, tmp_path: Path) -> None:
    two = ("--x", "bus.nodes=1,2", "--y", "cycle.period_us=500,1000")
    few = (*two, "--over", "payload.read_bytes=6,12")
    words = run("explore", "paper-1ms", *few, cwd=tmp_path).stdout
    assert run("map", "paper-1ms", *two, cwd=tmp_path).stdout in words
    document = json.loads(run("explore", "paper-1ms", *two, "--format", "json", cwd=tmp_path).stdout)
    assert document["over"] == {"key": "payload.read_bytes", "values": [6, 12, 24, 36, 48]}
    assert [one["over"] for one in document["maps"]] == [6, 12, 24, 36, 48]
    rows = run("explore", "paper-1ms", *few, "--format", "csv", cwd=tmp_path).stdout.splitlines()
    assert len(rows) == 1 + 2 * 4
    assert rows[0].startswith("profile,payload.read_bytes,bus.nodes,cycle.period_us,")


def test_circles_are_shown_where_the_cycle_fits(run: Run, tmp_path: Path) -> None:
    given = ("--x", "axes=8", "--y", "cycle.period_us=300,1000", "--over", "servo.x.position_gain_per_s=20,143")
    done = run("explore", "paper-1ms", *given, "--circle", "--jobs", "1", "-o", "p.html", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "wrote p.html\n")
    shown = settings((tmp_path / "p.html").read_text(), x=(8,), y=(300, 1000), over=(20, 143))
    circles = {(gain, period_us): (lines or {}).get("circle", "") for (period_us, _, gain), lines in shown}
    for gain in (20, 143):
        profile = busplan.load_profile("paper-1ms", changes={"servo.x.position_gain_per_s": gain})
        (test,) = busplan.circle_test(profile).results
        word = "passes" if test.passed else "fails, " + ", ".join(failure.name for failure in test.failures)
        assert test.max_contour_error_mm is not None
        assert circles[gain, 1000] == f"{word}; largest error {1000 * test.max_contour_error_mm:.3f} um"
    assert circles[20, 1000][:5] == "fails" != circles[143, 1000][:5]
    assert circles[20, 300] == circles[143, 300] == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--over", "payload.write_bytes"), "--over payload.write_bytes: expected KEY=VALUES"),
        (("--over", "bus.nods=1"), "over bus.nods: unknown key; did you mean nodes?"),
        (("--x", "bus.nodes=1:33"), "bus.nodes: 33 values; a slider has up to 32. A map or a sweep takes more"),
        (
            ("--x", "bus.nodes=1:32", "--y", "bus.gap_count=30:61", "--over", "payload.write_bytes=4:28:4"),
            "7,168 settings; an explorer has up to 5,000: give fewer values",
        ),
    ],
)
def test_what_cannot_be_done_is_said_and_leaves_nothing(
    refused: Refused, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    assert message in refused("explore", "paper-1ms", *arguments, "-o", "p.html", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


# --- in a browser

SHOWN = """({
  word: document.querySelector('.answer').textContent,
  lines: Object.fromEntries([...document.querySelectorAll('.card > div')].map(
    (row) => [...row.children].map((cell) => cell.textContent))),
  values: [...document.querySelectorAll('output')].map((output) => output.textContent),
  spoken: [...document.querySelectorAll('input')].map((slider) => slider.getAttribute('aria-valuetext')),
  maps: [...document.querySelectorAll('.maps > *')].map((map) => !map.hidden),
  wide: document.documentElement.scrollWidth,
  frame: (() => { const box = document.querySelector('.maps > :not([hidden]) .frame').getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2, box.width, box.height]; })(),
})"""


@pytest.fixture
def tab(page: Path) -> Iterator[Tab]:
    with browser() as opened:
        opened.open(page, width=1280)
        yield opened


def agrees(shown: dict[str, Any], period_us: float, axes: int, size: int) -> bool:
    lines = lines_of(period_us, axes, size)
    return {"": shown["word"], **shown["lines"]} == lines


@needs_chromium
def test_keys_move_the_sliders_and_everything_follows(tab: Tab) -> None:
    first = tab.run(SHOWN)
    assert agrees(first, 1000, 8, 4)  # the profile's own values where they are on the sliders, else the first
    tab.run("document.querySelector('input').focus()")
    tab.press("Home")
    tab.press("Tab")
    tab.press("End")
    tab.press("Tab")
    tab.press("End")
    shown = tab.run(SHOWN)
    assert shown["values"] == shown["spoken"] == ["300 us", "32", "64"]
    assert shown["maps"] == [False, True]
    assert agrees(shown, 300, 32, 64)
    (x, y, wide, tall), (old_x, old_y, *_) = shown["frame"], first["frame"]
    assert (x - old_x, y - old_y) == (pytest.approx(3 * wide, abs=4), pytest.approx(2 * tall, abs=4))
    tab.press("Tab")
    tab.run("document.querySelectorAll('input')[1].focus()")
    tab.press("ArrowLeft")
    assert tab.run(SHOWN)["word"] == "CANNOT EXIST"


@needs_chromium
def test_a_click_on_the_map_chooses_its_cell(tab: Tab) -> None:
    x, y, wide, tall = tab.run(SHOWN)["frame"]
    for kind in ("mousePressed", "mouseReleased"):
        place = {"x": x + wide, "y": y + tall, "button": "left", "clickCount": 1}
        tab.call("Input.dispatchMouseEvent", type=kind, **place)
    assert agrees(tab.run(SHOWN), 500, 16, 4)


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_the_page_fits_a_phone_and_is_read_without_its_script(page: Path, tmp_path: Path, width: int) -> None:
    plain = tmp_path / "plain.html"
    plain.write_text(page.read_text(encoding="utf-8").replace("script-src 'sha256-", "script-src 'sha256-no"))
    with browser() as tab:
        tab.open(page, width=width)
        assert tab.run(SHOWN)["wide"] <= width
        tab.open(plain, width=width)
        assert tab.run("document.querySelector('fieldset').hidden")
        assert tab.run("document.querySelector('.answer').textContent") == lines_of(1000, 8, 4)[""]
        assert tab.run("document.querySelectorAll('.maps > :not([hidden])').length") == 1
