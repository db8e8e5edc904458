"""The scanner of places: on the shapes that trip TOML readers, and on random documents against the standard library."""

import math
import re
import tomllib
from collections.abc import Iterator
from datetime import UTC
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from busplan.profile.document import decode
from busplan.profile.places import KeyPath, Place, comments, places

# --- what holds of every document -------------------------------------------------------------------------


def paths_of(value: object, path: KeyPath = ()) -> Iterator[tuple[KeyPath, object]]:
    """All paths of parsed data with their values, the top itself left out."""
    if path:
        yield path, value
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from paths_of(inner, (*path, key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from paths_of(inner, (*path, index))


def same(one: object, other: object) -> bool:
    """Equality that knows NaN, the sign of zero, and that 1 is neither 1.0 nor true."""
    if type(one) is not type(other):
        return False
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isnan(one) == math.isnan(other) and (math.isnan(one) or repr(one) == repr(other))
    return one == other


def check_key(text: str, place: Place, key: str) -> None:
    written = text[place.key_start : place.key_end]
    assert list(tomllib.loads(f"{written} = 0")) == [key]


def check(text: str) -> None:
    """Check all places of a document against what the standard library reads from it."""
    values = dict(paths_of(tomllib.loads(text)))
    found = places(text)
    assert all(text[at] == "#" for at in comments(text))
    assert set(found) == set(values)
    for path, value in values.items():
        place = found[path]
        span = text[place.value_start : place.value_end]
        if isinstance(value, dict | list) and not span.startswith(("[", "{")):
            # A table of headers or dotted keys has no text of its own.
            assert place[:2] == place[2:]
        else:
            assert same(tomllib.loads(f"x = {span}")["x"], value), (path, span)
        name = path[-1]
        if isinstance(name, str):
            check_key(text, place, name)
            if place[:2] != place[2:]:
                assert re.fullmatch(r"[ \t]*=[ \t]*", text[place.key_end : place.value_start])
        else:
            assert place[:2] == place[2:]


def spans(text: str) -> dict[str, tuple[str, str]]:
    """Every place as text: dotted path to key as written and value as written."""
    return {
        ".".join(map(str, path)): (text[place.key_start : place.key_end], text[place.value_start : place.value_end])
        for path, place in places(text).items()
    }


# --- shapes, by hand --------------------------------------------------------------------------------------

SHAPES = {
    "nothing": "",
    "only comments": "# [not.a.table]\n  # x = 1",
    "no line end at the end": "a = 1",
    "comment at the end without a line end": "a = 1 # [b]",
    "bare keys of every kind": "a-b_c = 1\n-x = 2\n_ = 3\nA9 = 4",
    "keys that look like numbers": "1234 = 1\n1.2 = 3\n[3.14]\n1e5 = 0\n-7 = 1\ninf = 1\ntrue = false\n0x1 = 2",
    "keys that look like dates": "1979-05-27 = 1",
    "dotted": "a.b.c = 1\na.b.d = 2\na.e = 3",
    "dotted with spaces": "a . b\t.  c = 1\n a  .d=2",
    "dotted out of order": "apple.type = 1\norange.type = 2\napple.skin = 3\norange.skin = 4",
    "dotted in a table": '[t]\nx.y = 1\nx."z" = 2\n[t.u]\nx.y = 3',
    "dotted, quoted parts": "\"a.b\".c = 1\na.'b.c' = 2\n\"a\" . 'd' = 3",
    "quoted keys": '"a b" = 1\n\'c d\' = 2\n"=" = 3\n\'#\' = 4\n"]" = 5\n\'"\' = 6\n"\'" = 7',
    "empty keys": '"" = 1\n[a]\n\'\'."" = 2\n[b.""]\nx = 1\n[b."".\'\']',
    "escaped keys": '"\\u00e9\\U0001F600" = 1\n"\\"" = 2\n"\\\\" = 3\n"\\t\\n" = 4\n"a\\\\\\"b" = 5',
    "unicode keys": '"ʎǝʞ" = 1\n["größe"]\n\'日本\' = 2',
    "unicode separators in text": 'a = "\u0085\u2028\u00a0"\nb = 1 # \u2028 x = 2\nc = 3',
    "headers with spaces and comments": "[ a ] # x\n[ a . b ]#y\n  [\ta.\"c\" ]\t# [z]\n  x = 1\n[ g .  h  . 'i' ]",
    "header of a quoted bracket": '["a]b"]\nx = 1\n[\'c]]\'."d[["]\ny = 2',
    "sub-table before its table": "[a.b]\nx = 1\n[a]\ny = 2\n[a.c]\n[a.b.d]",
    "empty tables": "[a]\n[b]\n[c.d]",
    "inline table": "t = { a = 1, b = 'x' }\nu = {}\nv = {  }",
    "inline table, nested": "t = {a = {b = {c = {}}}, d = {e = 1}}",
    "inline table, dotted keys": 't = { a.b = 1, a . c = 2, "d.e".f = {g.h = 3} }',
    "inline table of tricky text": 't = {a = "}", b = \'],\', c = "\\"}", d = "# no"} # } comment',
    "inline tables in an array": "t = [{x = 1, y = 2}, {}, {x = [{y = 3}]}]",
    "array of tables": "[[a]]\nx = 1\n[[a]]\n[[a]]\nx = 3\ny = 4",
    "array of tables, nested": "[[a]]\n[[a.b]]\nx = 1\n[[a.b]]\nx = 2\n[[a]]\n[[a.b]]\nx = 3",
    "array of tables with sub-tables": "[[a]]\n[a.s]\nx = 1\n[a.s.t]\n[[a]]\n[a.s]\nx = 2\ny.z = 3",
    "array of tables below an implied table": "[[a.b.c]]\nx = 1\n[[a.b.c]]\n[a.b.d]\nx = 2",
    "array of tables, spaced and quoted": '[[ a . "b" ]] # one\nx = 1\n[[a.\'b\']]\n[["a".b.c]]',
    "arrays": "a = [1, 2]\nb = []\nc = [ ]\nd = [[1], [], [[2, 3]]]\ne = [1,]",
    "arrays over lines": "a = [\n  1, # one ]\n  # two, ]\n\n  2\n  , # comma\n  3,\n]\nb = [ # x\n]\nc = [1 # y\n]",
    "array of text with brackets": "a = ['[', \"]\", ',', '#', \"\\\"]\", '''],''', \"\"\"[\"\"\"]",
    "array of mixed values": "a = [1, 1.0, true, 'x', 1979-05-27, [1], {b = 1}]",
    "basic strings": r"""a = "" # x
b = "\"" # "
c = "\\" # "
d = "\\\""
e = "# no comment"
f = "'"
g = "tab	inside\u0022\U00000022"
""",
    "literal strings": "a = '' # x\nb = '\\' # '\nc = '\"'\nd = '# no'\ne = ''",
    "multi-line basic": 'a = """x"""\nb = """\nx\n[y]\nz = 1\n"""\nc = """\\\n   x \\\n\n  y"""\nd = """# no"""',
    "multi-line basic, empty": 'a = """"""\nb = """\n"""\nc = """\\\n"""',
    "multi-line basic, quotes inside": 'a = """a"b""c"""\nb = """\\"""\\""""\nc = """x\\""""\nd = """\\\\"""',
    "multi-line basic, quotes and escaped quotes": 'a = """""\\""""""\nb = """\\\\\\""""',
    "multi-line basic, quotes at the ends": 'a = """"x""""\nb = """""x"""""\nc = """"""""\nd = """""""',
    "multi-line literal": "a = '''x'''\nb = '''\nx\n[y]\nz = 1\n'''\nc = '''\\'''\nd = '''#'''\ne = ''''''",
    "multi-line literal, quotes inside": "a = '''a'b''c'''\nb = '''\"\"\"'''\nc = '''it''s \\'''",
    "multi-line literal, quotes at the ends": "a = ''''x''''\nb = '''''x'''''\nc = ''''''''\nd = '''''''",
    "multi-line strings in arrays": 'a = ["""x\n]""", \'\'\'y,\n\'\'\', """z"""""]\nb = 1',
    "multi-line strings in inline tables": "t = {a = \"\"\"x\n}\"\"\", b = '''\n,'''}\nb = 1",
    "integers": "a = +1_000\nb = -0\nc = 0xDEAD_beef\nd = 0o755\ne = 0b1101#x\nf=0",
    "floats": "a = 6.626e-34\nb = -1E+2 # x\nc = inf\nd = -nan\ne = 9_2.0_1\nf = [1.5e1,-inf]\ng = -0.0",
    "booleans": "a = true#x\nb = [true,false]\nc = {d=true}",
    "dates and times": "a = 1979-05-27\nb = 07:32:00.5\nc = 1979-05-27T07:32:00Z\nd = 1979-05-27T07:32:00-07:00#x",
    "dates with a space": "a = 1979-05-27 07:32:00Z # x\nb = [1979-05-27 07:32:00, 1979-05-27 07:32:00.25-07:00 ]\n"
    "c = {d = 1979-05-27 07:32:00 , e = 1979-05-27 }",
    "spaces and tabs around everything": "\t a\t=\t1 \t\n \t[ b ]\t\n\tc\t=\t[\t1\t,\t2\t]\t\n",
    "blank lines at both ends": "\n\n \n\t\na = 1\n\n \n",
    "awkward": "\"'\" . a . '\"' = 1 # '\n[[ 'x' ]]\n[ x . y ]\nz = [ # ]\n{ a.b = [ ], c = '''''' } , ]",
    "deep nesting": "a = " + "[" * 90 + "{b = 1}" + "]" * 90,
}


def test_places_are_those_of_the_standard_library() -> None:
    for text in SHAPES.values():
        check(text)


def test_line_ends_of_windows_give_the_same_document() -> None:
    for text in SHAPES.values():
        document = decode(text.replace("\n", "\r\n").encode(), name="f")
        assert document.text == text
        assert (document.places, document.comments) == (places(text), comments(text))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param("a = 1 # x", {"a": ("a", "1")}, id="a comment is not the value's"),
        pytest.param("a = 1  \t\n", {"a": ("a", "1")}, id="nor are spaces"),
        pytest.param("a.b = 1", {"a": ("a", "a"), "a.b": ("b", "1")}, id="each part of a dotted key has its place"),
        pytest.param(
            "a.b = 1\na.c = 2",
            {"a": ("a", "a"), "a.b": ("b", "1"), "a.c": ("c", "2")},
            id="the shared part stands where it is first",
        ),
        pytest.param(
            'x = [1, "two" ]',
            {"x": ("x", '[1, "two" ]'), "x.0": ("1", "1"), "x.1": ('"two"', '"two"')},
            id="an element is its own key",
        ),
        pytest.param(
            "t = { a = {b = 1 } }",
            {"t": ("t", "{ a = {b = 1 } }"), "t.a": ("a", "{b = 1 }"), "t.a.b": ("b", "1")},
            id="an inline table's value is its braces",
        ),
        pytest.param("[ a . b ]", {"a": ("a", "a"), "a.b": ("b", "b")}, id="a header names each of its parts"),
        pytest.param(
            "[[a]]\n[[a]]\nx = 1",
            {"a": ("a", "a"), "a.0": ("a", "a"), "a.1": ("a", "a"), "a.1.x": ("x", "1")},
            id="tables of an array are counted",
        ),
        pytest.param(
            "d = 1979-05-27 07:32:00 # x", {"d": ("d", "1979-05-27 07:32:00")}, id="a date keeps the space inside"
        ),
        pytest.param(
            'a = """x"""""\nb = 1',
            {"a": ("a", '"""x"""""'), "b": ("b", "1")},
            id="two quotes before the closing three belong to the text",
        ),
    ],
)
def test_spans_are_as_written(text: str, expected: dict[str, tuple[str, str]]) -> None:
    assert spans(text) == expected


def test_a_tables_own_header_is_its_place_even_after_a_sub_tables() -> None:
    text = "[a.b]\n[a]\nx = 1"
    assert places(text)["a",] == Place(7, 8, 7, 8)


def test_every_table_of_an_array_stands_at_its_own_header() -> None:
    text = "[[a]]\n[[a]]\n[[a]]"
    found = places(text)
    assert [found["a", index].key_start for index in range(3)] == [2, 8, 14]
    assert found["a",].key_start == 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("# one\n  # two", ["# one", "# two"]),
        ("a = 1 # one\n[b] # two\nc = 2# three", ["# one", "# two", "# three"]),
        (
            "a = [ # one\n  1, # two ] # still two\n  # three\n] # four",
            ["# one", "# two ] # still two", "# three", "# four"],
        ),
        ('a = \'# no\'\nb = "# no"\n\'# no\' = """\n# no""" # yes', ["# yes"]),
    ],
)
def test_comments_stand_where_their_hash_does(text: str, expected: list[str]) -> None:
    assert [text[at:].partition("\n")[0] for at in comments(text)] == expected


def test_a_key_and_an_index_of_the_same_digits_are_two_things() -> None:
    assert set(places("a = [7]\nb.0 = 7")) == {("a",), ("a", 0), ("b",), ("b", "0")}


def test_deep_nesting_costs_no_recursion() -> None:
    depth = 2_000  # tomllib refuses that, and the scanner must not be what fails
    assert len(places("a = " + "[" * depth + "]" * depth)) == depth


def test_a_long_array_is_read_to_its_end() -> None:
    text = f"a = [{'1, ' * 5000}]"
    assert places(text)["a", 4999] == Place(15_002, 15_003, 15_002, 15_003)


def test_text_that_is_no_toml_ends_in_an_error_and_not_in_a_loop() -> None:
    with pytest.raises(ValueError, match="no key at offset 2"):
        places("a.= 1")


# --- random documents, dumped -----------------------------------------------------------------------------

AWKWARD = st.text(alphabet="ab0.-_ \"'#[]{}=,\\\n\t\r\x00\x7fé\u2028\U0001f600", max_size=8)
SCALARS = st.one_of(
    AWKWARD,
    st.text(max_size=5),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.booleans(),
    st.dates(),
    st.times(),
    st.datetimes(),
    st.datetimes(timezones=st.just(UTC)),
)
TREES = st.dictionaries(
    AWKWARD,
    st.recursive(
        SCALARS,
        lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(AWKWARD, inner, max_size=4)),
        max_leaves=12,
    ),
    max_size=6,
)


@given(tree=TREES, multiline=st.booleans())
def test_places_of_dumped_data_are_those_of_the_data(tree: dict[str, Any], multiline: bool) -> None:
    text = tomli_w.dumps(tree, multiline_strings=multiline).replace("\r\n", "\n")
    check(text)
