"""Files written whole or not at all, documents with lines, commands with exit statuses."""

import argparse
import json
import os

import pytest

from srs_opt.command import (
    Answer,
    finite_float,
    make_parser,
    positive_float,
    positive_int,
    progress,
    run_command,
    say,
)
from srs_opt.document import Document, parse_yaml, unknown_word, validate
from srs_opt.errors import (
    InputError,
    NoAnswerError,
    OutOfReachError,
    SrsError,
    UnsupportedEffectError,
)
from srs_opt.files import atomic_path, read_bytes, read_text, write_json, write_text, write_with


def test_errors_are_builtins_too():
    assert issubclass(InputError, (SrsError,))
    assert issubclass(InputError, ValueError)
    assert issubclass(NoAnswerError, RuntimeError)
    assert issubclass(OutOfReachError, NoAnswerError)
    assert issubclass(UnsupportedEffectError, NotImplementedError)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    target = tmp_path / "new" / "table.csv"
    write_text(target, "old\n")

    def fails(stream):
        stream.write("half")
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        write_with(target, fails)
    assert target.read_text() == "old\n"
    assert os.listdir(target.parent) == ["table.csv"]


def test_written_files_have_ordinary_permissions(tmp_path):
    path = write_text(tmp_path / "a.txt", "x")
    mask = os.umask(0)
    os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


def test_places_that_cannot_be_written_are_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    for target in (tmp_path / "file" / "x.txt", tmp_path):
        with pytest.raises(InputError, match=r"cannot write: .*--out") as caught:
            write_text(target, "x")
        assert "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path)) == ["file"]


def test_json_without_not_a_number(tmp_path):
    assert json.loads(write_json(tmp_path / "a.json", {"x": [1, 2.5]}).read_text()) == {"x": [1, 2.5]}
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "b.json", {"x": float("nan")})
    assert not (tmp_path / "b.json").exists()


def test_text_in_any_line_ends_and_with_a_byte_order_mark(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\rc\n")
    assert read_text(path, "text") == "a\nb\nc\n"


def test_what_is_no_readable_file_is_said(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "big").write_bytes(b"x" * 2_000_000)
    cases = {
        "pipe": "not a file",
        "loop": "loop",
        "big": "too large for a maze",
        "none": "no such file",
        ".": "folder",
    }
    for name, words in cases.items():
        with pytest.raises(InputError, match=words):
            read_bytes(tmp_path / name, "a maze", limit=1_000_000)


def test_atomic_paths_keep_the_suffix(tmp_path):
    with atomic_path(tmp_path / "picture.png") as temporary:
        assert temporary.suffix == ".png"
        temporary.write_bytes(b"png")
    assert (tmp_path / "picture.png").read_bytes() == b"png"


def test_documents_know_the_line_of_every_key():
    document = parse_yaml("a: 1\nb:\n  - c: 2\n    d: 3\n", "f.yaml", "a thing")
    assert document.value == {"a": 1, "b": [{"c": 2, "d": 3}]}
    assert document.where(("b", 0, "d")) == "f.yaml:4"
    assert document.where(("b", 0, "missing")) == "f.yaml:3"
    assert str(document.error(("b", 0, "d"), "is wrong")) == "f.yaml:4: b[0].d: is wrong"
    assert Document("memory", {}).where(("x",)) == "memory"


def test_yaml_without_surprises():
    """1e-6 is a number, yes and dates are text, 010 is ten, merge keys and octals are nothing special."""
    text = "a: 1e-6\nb: yes\nc: 2020-01-01\nd: 010\ne: 0x1F\nf: 1:30\ng: null\nh: true\ni: -.5\n"
    assert parse_yaml(text, "f", "a thing").value == {
        "a": 1e-6,
        "b": "yes",
        "c": "2020-01-01",
        "d": 10,
        "e": "0x1F",
        "f": "1:30",
        "g": None,
        "h": True,
        "i": -0.5,
    }


def test_a_key_that_is_no_text_is_refused_with_its_line():
    schema = {"type": "object", "properties": {"a": {}}, "additionalProperties": False}
    with pytest.raises(InputError, match=r"f:2: 7: unknown key '7'"):
        validate(parse_yaml("a: 1\n7: 2\n", "f", "a thing"), schema)
    with pytest.raises(InputError, match="a key must be a word"):
        parse_yaml("[1, 2]: 3\n", "f", "a thing")


def test_near_misses_are_suggested():
    assert (
        unknown_word("key", "lenght", ["length", "width"]) == "unknown key 'lenght' (did you mean 'length'?)"
    )
    assert "known: a, b" in unknown_word("key", "zzz", ["a", "b"])


def parser():
    return make_parser("python -m srs_opt.thing", "does things", "python -m srs_opt.thing", sweep=True)


def test_exit_statuses_and_streams(capsys):
    def run(arguments, answer):
        status = run_command(parser(), answer, arguments)
        return (status, *capsys.readouterr())

    good = Answer({"x": 1.0}, "all fine")
    assert run([], lambda o: good) == (0, "all fine\n", "")
    assert run(["--json"], lambda o: good) == (0, '{"x": 1.0}\n', "")
    assert run(["--quiet"], lambda o: good) == (0, "", "")
    assert run([], lambda o: Answer({}, "no", good=False))[0] == 1

    def bad_input(options):
        raise InputError("f.yaml:3: a\nb")

    def no_answer(options):
        raise NoAnswerError("no way through")

    status, out, err = run([], bad_input)
    assert (status, out) == (2, "")
    assert err == "python -m srs_opt.thing: f.yaml:3: a b\n"
    status, out, err = run(["--json"], no_answer)
    assert status == 1
    assert json.loads(out)["error"] == "no way through"
    assert "no way through" in err


def test_bad_usage_is_one_line(capsys):
    for arguments in (["--jobs", "0"], ["--nonsense"], ["--seed", "x"], ["--rob", "x"]):
        with pytest.raises(SystemExit) as caught:
            run_command(parser(), lambda o: Answer({}, ""), arguments)
        assert caught.value.code == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_a_model_that_no_plugin_defines_is_refused_in_one_line(capsys):
    """Plugins may define models, so that the name is looked at when they have run: before anything slow."""
    assert run_command(parser(), lambda o: pytest.fail("it began"), ["--model", "other"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "complex, simplified, compliant" in err


def test_default_folder_is_named_after_the_command(capsys):
    seen = []
    run_command(parser(), lambda o: seen.append(o.out) or Answer({}, ""), [])
    assert str(seen[0]) == os.path.join("out", "thing")


def test_numbers_on_the_command_line():
    assert positive_int("3") == 3
    assert positive_float("1e-3") == 1e-3
    assert finite_float("-2.5") == -2.5
    for parse, text in (
        (positive_int, "0"),
        (positive_int, "1.5"),
        (positive_float, "0"),
        (positive_float, "nan"),
        (finite_float, "inf"),
        (finite_float, "x"),
    ):
        with pytest.raises(argparse.ArgumentTypeError, match="expected"):
            parse(text)


def test_quiet_is_quiet(capsys):
    options = argparse.Namespace(quiet=True)
    say(options, "hello")
    assert list(progress([1, 2], options, "counting")) == [1, 2]
    assert capsys.readouterr() == ("", "")
    say(argparse.Namespace(quiet=False), "hello")
    assert capsys.readouterr() == ("", "hello\n")
