"""Reading of YAML: values, lines, duplicate keys, extends."""

from pathlib import Path

import pytest

from rig.config.problems import ConfigError
from rig.config.yaml_source import SourceLocation, load_mapping


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def reported_problems(path: Path) -> list[str]:
    with pytest.raises(ConfigError) as error_info:
        load_mapping(path)
    return [
        f"{Path(p.file).name}:{p.line}: {p.key}: {p.message}" for p in error_info.value.problems
    ]


def test_yaml_1_2_values(tmp_path: Path) -> None:
    text = "a: 1e3\nb: on\nc: yes\nd: 2023-09-26\ne: 12:30\nf: .5\ng: -3\nh: true\ni: 0x10\nj:\n"
    mapping, _ = load_mapping(write(tmp_path, "x.yaml", text))
    assert mapping == {
        "a": 1000.0, "b": "on", "c": "yes", "d": "2023-09-26", "e": "12:30", "f": 0.5,
        "g": -3, "h": True, "i": 16, "j": None,
    }  # fmt: skip
    assert type(mapping["a"]) is float
    assert type(mapping["g"]) is int


def test_every_value_has_its_line(tmp_path: Path) -> None:
    path = write(tmp_path, "x.yaml", "a:\n  b:\n    - 1\n    - {c: 2,\n       d: 3}\n\ne: 4\n")
    _, locate = load_mapping(path)
    assert locate(("a",)).line == 1
    assert locate(("a", "b")).line == 2
    assert locate(("a", "b", 0)).line == 3
    assert locate(("a", "b", 1, "c")).line == 4
    assert locate(("a", "b", 1, "d")).line == 5
    assert locate(("e",)) == SourceLocation(path, 7)
    assert locate(("a", "missing")).line == 1
    assert locate(("missing",)).line == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x.yaml:1: : the file holds nothing, not a mapping"),
        ("- 1\n- 2\n", "x.yaml:1: : the file holds a list, not a mapping"),
        ("hello\n", "x.yaml:1: : the file holds 'hello', not a mapping"),
        ("a: 1\nb: [1, 2\nc: 3\n", "x.yaml:3: : YAML syntax: "),
        ("a: 1\n\tb: 2\n", "x.yaml:2: : YAML syntax: "),
        ("a: *there\n", "x.yaml:1: : YAML syntax: found undefined alias"),
        ("a: 1\n---\nb: 2\n", "x.yaml:2: : YAML syntax: but found another document"),
        ("a: 1\nb: 2\na: 3\n", "x.yaml:3: a: duplicate key, first on line 1"),
        ("s:\n  a: 1\n  a: 1\n", "x.yaml:3: s.a: duplicate key, first on line 2"),
        ("s: {}\n? [1, 2]\n: 3\n", "x.yaml:2: : a key must be plain text"),
        (
            "a: &x {b: 1}\nc:\n  <<: *x\n",
            "x.yaml:3: c.<<: merge keys are not supported; use extends",
        ),
        ("a: !money 3\n", "x.yaml:1: a: the tag !money is not supported"),
        ("a: !!int three\n", "x.yaml:1: a: 'three' is not a number"),
        (f"a: 1{'0' * 400}\n", "x.yaml:1: a: a whole number of more than 64 bits"),
        (f"a: 1{'0' * 9000}\n", "x.yaml:1: a: '1000"),
        ("a: &x [*x]\n", "x.yaml:1: a[0]: an alias that contains itself"),
        ("a: " + "[" * 5000, "x.yaml:1: : nested too deeply; allowed at most 50 levels"),
        ("a:\n" + "".join(f"{' ' * i}- \n" for i in range(60)), "x.yaml:51: : nested too deeply"),
        (
            "a0: &a0 [1, 2]\n"
            + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 31)),
            "x.yaml:1: a14",
        ),
        ("a: \x01\n", "x.yaml:1: : YAML syntax: "),
    ],
)
def test_an_unreadable_file_is_reported(tmp_path: Path, text: str, message: str) -> None:
    (problem,) = reported_problems(write(tmp_path, "x.yaml", text))
    assert problem.startswith(message)


def test_all_duplicate_keys_are_reported(tmp_path: Path) -> None:
    assert len(reported_problems(write(tmp_path, "x.yaml", "a: 1\na: 2\nb: 1\nb: 2\n"))) == 2


def test_missing_folder_and_binary_files(tmp_path: Path) -> None:
    assert "No such file" in reported_problems(tmp_path / "none.yaml")[0]
    assert "Is a directory" in reported_problems(tmp_path)[0]
    path = tmp_path / "b.yaml"
    path.write_bytes(b"a: \xff\xfe\n")
    assert reported_problems(path) == ["b.yaml:1: : the file is not UTF-8 text (byte 3)"]


def test_extends_merges_mappings_and_keeps_the_location_of_each_value(tmp_path: Path) -> None:
    base = write(tmp_path, "sub/base.yaml", "a:\n  x: 1\n  y: 2\nlist: [1, 2]\nfile: f.csv\n")
    top = write(tmp_path, "top.yaml", "extends: sub/base.yaml\na:\n  y: 3\n  z: 4\nlist: [9]\n")
    mapping, locate = load_mapping(top)
    assert mapping == {"a": {"x": 1, "y": 3, "z": 4}, "list": [9], "file": "f.csv"}
    assert locate(("a", "x")) == SourceLocation(base, 2)
    assert locate(("a", "y")) == SourceLocation(top, 3)
    assert locate(("list", 0)) == SourceLocation(top, 5)
    assert locate(("list", 1)) == SourceLocation(top, 5)  # the base's second entry is replaced
    assert locate(("missing",)) == SourceLocation(top, 1)
    assert locate.files == (top, base)
    # a file name is relative to the file that contains it
    assert locate.resolve_path(("file",), "f.csv") == tmp_path / "sub" / "f.csv"


def test_an_empty_value_removes_an_inherited_key(tmp_path: Path) -> None:
    write(tmp_path, "base.yaml", "a: {x: 1, y: 2}\nb: 3\n")
    top = write(tmp_path, "top.yaml", "extends: base.yaml\na:\n  x:\nb:\nc:\n")
    assert load_mapping(top)[0] == {"a": {"y": 2}, "c": None}


def test_a_mapping_of_another_kind_is_replaced(tmp_path: Path) -> None:
    write(tmp_path, "base.yaml", "sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.5}\n")
    other = "extends: base.yaml\nsea: {kind: jonswap, hs_m: 0.1, tp_s: 2}\n"
    same = "extends: base.yaml\nsea: {amplitude_m: 0.2}\n"
    assert load_mapping(write(tmp_path, "a.yaml", other))[0] == {
        "sea": {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2}
    }
    assert load_mapping(write(tmp_path, "b.yaml", same))[0] == {
        "sea": {"kind": "regular", "amplitude_m": 0.2, "frequency_hz": 0.5}
    }


def test_extends_in_a_chain_and_in_a_circle(tmp_path: Path) -> None:
    write(tmp_path, "a.yaml", "extends: b.yaml\nx: 1\n")
    write(tmp_path, "b.yaml", "y: 2\nextends: c.yaml\n")
    c = write(tmp_path, "c.yaml", "x: 0\nz: 3\n")
    assert load_mapping(tmp_path / "a.yaml")[0] == {"x": 1, "y": 2, "z": 3}
    c.write_text("extends: a.yaml\n")
    assert reported_problems(tmp_path / "a.yaml") == [
        "c.yaml:1: extends: files extend in a circle: a.yaml -> b.yaml -> c.yaml -> a.yaml"
    ]


def test_a_missing_extended_file_is_reported_where_it_is_named(tmp_path: Path) -> None:
    top = write(tmp_path, "top.yaml", "x: 1\nextends: none.yaml\n")
    (problem,) = reported_problems(top)
    assert problem.startswith("top.yaml:2: extends: cannot read ")
    top.write_text("x: 1\nextends: 3\n")
    assert reported_problems(top) == ["top.yaml:2: extends: 3 is not a file name"]


def test_a_file_with_too_many_values_is_reported_at_the_line_that_exceeds_the_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.config.yaml_source.MAX_NODES", 10)
    (problem,) = reported_problems(write(tmp_path, "x.yaml", "a:\n" + "- 1\n" * 20))
    assert problem.startswith("x.yaml:9: : too many keys and values; allowed at most ")
