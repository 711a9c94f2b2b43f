"""What hostile files are made of: values that no config means, and changes of the files that are shipped."""

import re
import tomllib
from pathlib import Path

import tomli_w
from hypothesis import strategies as st

ROOT = Path(__file__).parents[3]
STUDIES = ROOT / "studies"
CONFIG_FILES = sorted(STUDIES.glob("configs/*.toml"))
FIGURE_FILES = sorted(STUDIES.glob("paper/*.toml"))
STUDY_FILES = sorted(
    [*STUDIES.glob("*.toml"), *STUDIES.glob("work_precision/*.toml"), *STUDIES.glob("stability/*.toml")]
)

NUMBERS = (
    "0", "-1", "1", "2", "3", "0.5", "1e308", "-1e308", "1e-308", "5e-324", "-0.0", "0.0", "1e16", "nan", "inf", "-inf",
    "9007199254740993", "9223372036854775807", "9223372036854775808", "-9223372036854775809", "1" + "0" * 400,
    "9" * 5000, "0x" + "f" * 5000, "1e99999", "1e150", "1e-150", "1_000_000_000_000",
)  # fmt: skip
WORDS = (
    '""', '"x"', '" "', '"../../outside"', '"/etc/passwd"', '"~"', '"a\\u0000b"', '"\\u001b[31mred"', '"\\u202eltr"',
    '"\\u05e9\\u05dc\\u05d5\\u05dd"', '"\\U0001F40C"', '"$\\\\frac{"', '"![](/etc/passwd)"', '"<script>"', '"%s%n{}"',
    '"__import__(\'os\').system(\'touch pwned\')"', '"os.system"', '"cvxpy:os.system"', '"cvxpy:"', '"installed"',
    '"auto"', '"point_mass"', '"a.b.c"', '"custom"', '"true"', '"1"', "'''\na\nb'''", '"' + "x" * 100_000 + '"',
)  # fmt: skip
OTHERS = (
    "true", "false", "[]", "{}", "[[]]", "[[1.0], [1.0, 2.0]]", "[1, true]", '["a"]', "[1.0, nan]", "1979-05-27",
    "07:32:00", "1979-05-27T07:32:00Z", "{ __class__ = 1 }", '{ name = "point_mass" }', "{ count = 3 }",
    "{ count = 1000000000 }", "{ values = [] }", "[" * 40 + "]" * 40, "[" * 3000 + "]" * 3000,
    "{ a = " * 500 + "1" + "}" * 500,
    "[" + "1.0, " * 10_000 + "]", "[" + "[1.0, 2.0], " * 100 + "]", '{ backend = "osqp", options = { max_iter = -1 } }',
    "[{ label = 1 }, { label = 1 }]", "{ seed = -1, position = 1e300, momentum = 1e300 }",
)  # fmt: skip
LITERALS = st.sampled_from([*NUMBERS, *WORDS, *OTHERS])
KEYS = (
    '"__class__"', '"__init__.__globals__"', '""', '" "', '"a\\nb"', '"\\u001b[2J"', '"\\u202e"', '"é"', "a" * 10_000,
    ".".join("a" * 30), ".".join("a" * 2000), "scene", "solvers", "record.output", "output", "values", "axes", "steps",
)  # fmt: skip
BYTES = (
    b"\x00",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\r",
    b"=",
    b"[",
    b"]",
    b'"',
    b"'''",
    b"#",
    b"\n",
    b".",
    b"{",
    b"e999",
    b"-",
    b"\\",
)


@st.composite
def changed_structure(draw, table):
    """A table in TOML after one to three changes of its entries; also the last parts of the keys that it has had."""
    tree = tomllib.loads(tomli_w.dumps(table))
    raw: dict[str, str] = {}
    for number in range(draw(st.sampled_from((1, 1, 1, 2, 3)))):
        places = list(_places(tree))
        if not places:
            break
        parent, key = draw(st.sampled_from(places))
        change = draw(st.sampled_from(("value", "value", "value", "remove", "rename", "add", "wrap", "swap", "repeat")))
        if change == "value":
            parent[key] = _placeholder(raw, draw(LITERALS), number)
        elif change == "remove":
            del parent[key]
        elif change == "wrap":
            parent[key] = [parent[key]]
        elif change == "swap":
            other, name = draw(st.sampled_from(places))
            parent[key], other[name] = _copy(other[name]), _copy(parent[key])
        elif change == "repeat" and isinstance(parent[key], list):
            parent[key] = parent[key] * draw(st.integers(2, 30))
        elif change == "rename" and isinstance(parent, dict):
            parent[f"@@{number}@@"] = parent.pop(key)
            raw[f'"@@{number}@@"'] = draw(st.sampled_from(KEYS))
        elif isinstance(parent, dict):
            marker = f"@@{number}@@"
            parent[marker] = _placeholder(raw, draw(LITERALS), number + 100)
            raw[f'"{marker}"'] = draw(st.sampled_from(KEYS))
    text = tomli_w.dumps(tree)
    for marker, literal in raw.items():
        text = text.replace(marker, literal)
    return text


@st.composite
def changed_text(draw, text):
    """A file's bytes after some of them were changed, cut off, repeated or mixed."""
    found = text.encode()
    for _ in range(draw(st.integers(1, 6))):
        place = draw(st.integers(0, len(found)))
        end = min(len(found), place + draw(st.integers(0, 40)))
        change = draw(st.sampled_from(("insert", "remove", "cut", "repeat", "replace", "word")))
        if change == "insert":
            found = found[:place] + draw(st.sampled_from(BYTES)) + found[place:]
        elif change == "remove":
            found = found[:place] + found[end:]
        elif change == "cut":
            found = found[:place] if draw(st.integers(0, 4)) == 0 else found[:place] + b"\n" + found[end:]
        elif change == "repeat":
            found = found[:end] + found[place:end] + found[end:]
        elif change == "replace":
            found = found[:place] + draw(st.binary(max_size=3)) + found[place + 1 :]
        else:
            found = re.sub(rb"(?<== )[^\n]+", lambda _: draw(LITERALS).encode(), found, count=1)
    return found


def nested_tables():
    """Tables of any shape whose keys are those of configs, or not, and whose values are hostile."""
    names = (
        "scene",
        "method",
        "solvers",
        "record",
        "name",
        "backend",
        "options",
        "default",
        "steps",
        "step_size",
        "mass",
    )
    keys = st.sampled_from(names) | st.text(max_size=4)
    leaves = (
        st.integers() | st.floats() | st.booleans() | st.text(max_size=6)
        | st.sampled_from(["point_mass", "newtons_cradle", "gvi", "osqp", "native", "cvxpy:CLARABEL"])
    )  # fmt: skip
    inner = st.recursive(
        leaves, lambda more: st.lists(more, max_size=4) | st.dictionaries(keys, more, max_size=4), max_leaves=12
    )
    return st.dictionaries(keys, inner, max_size=6).map(tomli_w.dumps)


def _places(node):
    """Containers and keys of all entries of a tree."""
    for key, value in list(node.items() if isinstance(node, dict) else enumerate(node)):
        yield node, key
        if isinstance(value, dict | list):
            yield from _places(value)


def _placeholder(raw, literal, number):
    marker = f"@@v{number}@@"
    raw[f'"{marker}"'] = literal
    return marker


def _copy(value):
    if isinstance(value, dict):
        return {key: _copy(entry) for key, entry in value.items()}
    return [_copy(entry) for entry in value] if isinstance(value, list) else value
