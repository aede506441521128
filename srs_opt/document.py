"""YAML and JSON documents validated against a JSON schema, complaints with line numbers.

A document keeps the line of every key, so that a message can say
``robot.yaml:7: unknown key 'lenght' (did you mean 'length'?)``.
"""

from __future__ import annotations

import difflib
import json
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib import resources
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from srs_opt.errors import InputError
from srs_opt.files import read_text

Place = tuple[str | int, ...]
MAX_VALUES, MAX_DEPTH = 1_000_000, 50
MOST_VIOLATIONS = 1000  # looked for: a long list may be wrong all over
_TAGS = {f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str", "seq", "map")}


@dataclass(frozen=True)
class Document:
    """A parsed file: plain values and the line on which each stands."""

    source: str
    value: Any
    lines: dict[Place, int] = field(default_factory=dict)
    usable: bool = False  # every value is known to be one that a format can mean

    def where(self, place: Place) -> str:
        """Return ``file:line`` of the value at `place` (or of its nearest parent)."""
        while place and place not in self.lines:
            place = place[:-1]
        line = self.lines.get(place)
        return f"{self.source}:{line}" if line else self.source

    def error(self, place: Place, message: str) -> InputError:
        """Return an error that names the file, the line and the key."""
        key = format_place(place)
        words = f"{key + ': ' if key else ''}{message}"
        return InputError(f"{self.where(place)}: {' '.join(words.split())}")


def format_place(place: Place) -> str:
    """Return a readable key path: ``walls[2].segment``."""
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # the C one where built: faster
    """YAML with 1e-6 as a number (YAML 1.1 reads it as text), no dates, no yes/no."""


_Loader.yaml_implicit_resolvers = {}
_SCALARS = {
    "tag:yaml.org,2002:null": (r"~|null|Null|NULL|", "~nN\0"),
    "tag:yaml.org,2002:bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "tag:yaml.org,2002:int": (r"[-+]?[0-9]+", "-+0123456789"),
    "tag:yaml.org,2002:float": (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
}
for _tag, (_pattern, _first) in _SCALARS.items():
    _Loader.add_implicit_resolver(
        _tag, re.compile(rf"^(?:{_pattern})$"), [c for c in _first if c != "\0"] + [""] * ("\0" in _first)
    )
_Loader.add_constructor(
    "tag:yaml.org,2002:int",
    lambda loader, node: int(str(loader.construct_scalar(node))),  # no octal
)


def read_yaml(path: Path | str, what: str, *, lenient: bool = False) -> Document:
    """Read a YAML file (JSON is YAML too) into a `Document`.

    A `lenient` reader gets numbers that are not finite too, to list them among the `violations`.

    Raises
    ------
    InputError
        If the file cannot be read, is not YAML, repeats a key or nests too deeply.
    """
    document = _parsed(read_text(path, what), str(path), what)
    return document if lenient else _checked(document)


def parse_yaml(text: str, source: str, what: str) -> Document:
    """Parse YAML `text`; `source` is named in complaints."""
    return _checked(_parsed(text, source, what))


def _parsed(text: str, source: str, what: str) -> Document:
    loader = None
    try:
        _check_size(text, source)
        loader = _Loader(text)
        node = loader.get_single_node()
        lines: dict[Place, int] = {}
        if node is not None:
            _walk(node, (), lines, source, 0)
        value = loader.construct_document(node) if node is not None else None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{source}:{mark.line + 1}" if mark else source
        raise InputError(f"{place}: not valid YAML: {error.problem} (expected {what})") from error
    except InputError:
        raise
    except (yaml.YAMLError, ValueError, OverflowError, AttributeError, LookupError, TypeError) as error:
        # the last three: what the constructors raise for a tag on a text that does not suit it
        detail = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise InputError(f"{source}: not valid YAML: {detail} (expected {what})") from error
    except RecursionError as error:
        raise InputError(f"{source}: nested too deeply (expected {what})") from error
    finally:
        if loader is not None:
            loader.dispose()
    return Document(source, value, lines)


def read_json(path: Path | str, what: str) -> Document:
    """Read a JSON file that a program wrote, however large (YAML's parser takes seconds per megabyte).

    Raises
    ------
    InputError
        If the file cannot be read or is not JSON.
    """
    text = read_text(path, what)
    try:
        return _checked(Document(str(path), json.loads(text)))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}:{error.lineno}: not valid JSON: {error.msg} (expected {what})") from error
    except RecursionError as error:
        raise InputError(f"{path}: nested too deeply (expected {what})") from error


def _check_size(text: str, source: str) -> None:
    """Refuse too many values before anything is built of them (a minute and gigabytes).

    Raises RecursionError for deep nesting: composing recurses, in the C parser without a guard.
    """
    depth = 0
    for number, event in enumerate(yaml.parse(text, Loader=_Loader)):
        if number > 2 * MAX_VALUES:  # a value is an event, a list or a mapping two
            raise InputError(f"{source}: more than {MAX_VALUES} values in it")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise RecursionError


def _walk(node: yaml.Node, place: Place, lines: dict[Place, int], source: str, depth: int) -> None:
    if depth > MAX_DEPTH:
        raise RecursionError
    if len(lines) > MAX_VALUES:  # aliases of aliases make few characters into many values
        raise InputError(f"{source}: more than {MAX_VALUES} values in it")
    if node.tag not in _TAGS:
        raise InputError(
            f"{source}:{node.start_mark.line + 1}: tag {node.tag[:60]!r} is not understood; remove it"
        )
    lines.setdefault(place, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        seen = set()
        for key, child in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else None
            if name is None:
                raise InputError(f"{source}:{key.start_mark.line + 1}: a key must be a word")
            if name in seen:
                raise InputError(f"{source}:{key.start_mark.line + 1}: key '{name}' is given twice")
            seen.add(name)
            inside: Place = (*place, name)
            lines[inside] = key.start_mark.line + 1
            _walk(child, inside, lines, source, depth + 1)
    elif isinstance(node, yaml.SequenceNode):
        for index, child in enumerate(node.value):
            _walk(child, (*place, index), lines, source, depth + 1)


@lru_cache
def load_schema(package: str, name: str) -> dict[str, Any]:
    """Return the JSON schema `name` shipped inside `package`."""
    schema: dict[str, Any] = json.loads(resources.files(package).joinpath(name).read_text(encoding="utf-8"))
    return schema


def validate(document: Document, schema: dict[str, Any]) -> None:
    """Check `document` against `schema`.

    Raises
    ------
    InputError
        For the most telling violation: file, line, key, what was found and what was expected.
    """
    found = violations(document, schema)
    if found:
        raise found[0]


def violations(document: Document, schema: dict[str, Any]) -> list[InputError]:
    """Return everything in `document` that breaks `schema`, the most telling first."""
    import jsonschema

    if document.value is None:
        return [document.error((), f"is empty (expected {_TYPES.get(schema.get('type', ''), 'content')})")]
    bad = {} if document.usable else dict(islice(_unusable(document.value, ()), MOST_VIOLATIONS))
    found = [document.error(place, complaint) for place, complaint in bad.items()]
    validator = jsonschema.Draft202012Validator(schema)
    errors = list(islice(validator.iter_errors(document.value), MOST_VIOLATIONS))
    for error in sorted(errors, key=lambda e: (e.validator != "additionalProperties", len(e.absolute_path))):
        if error.context:  # anyOf / oneOf: the branch that got furthest tells most
            error = jsonschema.exceptions.best_match([error]) or error
        place: Place = tuple(error.absolute_path)
        if error.validator == "additionalProperties":
            known = sorted(error.schema.get("properties", {}))
            unknown = [str(k) for k in error.instance if k not in known]
            found += [document.error((*place, k), unknown_word("key", k, known)) for k in unknown]
        elif place not in bad:
            found.append(document.error(place, _plain(error)))
    return found


def unknown_word(kind: str, word: str, known: list[str]) -> str:
    """Return ``unknown key 'x' (did you mean 'y'?)``."""
    close = difflib.get_close_matches(word, known, n=1)
    hint = f"did you mean '{close[0]}'?" if close else f"known: {', '.join(known)}"
    return f"unknown {kind} '{word[:60]}' ({hint})"


def _checked(document: Document) -> Document:
    """Return `document`; what no format means is refused for all of them: inf, nan, half a character."""
    for place, complaint in _unusable(document.value, ()):
        raise document.error(place, complaint)
    return replace(document, usable=True)


def _unusable(value: Any, place: Place) -> Iterator[tuple[Place, str]]:
    if isinstance(value, (int, float)) and not abs(value) <= sys.float_info.max:
        yield place, "must be a finite number"
    if isinstance(value, str) and not _is_unicode(value):
        yield place, "must be text in Unicode, found a lone surrogate"
    children: Iterable[tuple[str | int, Any]] = ()
    if isinstance(value, dict):
        children = value.items()
    elif isinstance(value, list):
        children = enumerate(value)
    for key, child in children:
        if isinstance(key, str) and not _is_unicode(key):
            yield place, "has a key that is no text in Unicode: a lone surrogate"
        yield from _unusable(child, (*place, key))


def _is_unicode(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


_TYPES = {
    "object": "a mapping of keys",
    "array": "a list",
    "number": "a number",
    "integer": "a whole number",
    "string": "text",
    "boolean": "true or false",
    "null": "nothing",
}


_THOUSANDTHS = {"m": "millimetres", "kg": "grams", "s": "milliseconds"}


def _thousandths(error: Any) -> str:
    """Return a hint where a value a thousand times smaller would do and its key names a unit."""
    if error.validator != "maximum" or not error.absolute_path:
        return ""
    unit = str(error.absolute_path[-1]).rsplit("_", 1)[-1]
    fits = error.instance / 1000 <= error.validator_value
    return f" (in {_THOUSANDTHS[unit]}?)" if fits and unit in _THOUSANDTHS else ""


def _plain(error: Any) -> str:
    """Say a schema violation in words."""
    found: str = repr(error.instance)
    found = found if len(found) <= 60 else found[:57] + "..."
    limit = error.validator_value
    if error.validator == "type":
        kinds = limit if isinstance(limit, list) else [limit]
        return f"expected {' or '.join(_TYPES.get(str(k), str(k)) for k in kinds)}, found {found}"
    if error.validator == "required":
        missing = next(k for k in limit if k not in error.instance)
        return f"key '{missing}' is missing"
    words = {
        "minimum": f"must be at least {limit}",
        "maximum": f"must be at most {limit}{_thousandths(error)}",
        "exclusiveMinimum": f"must be greater than {limit}",
        "exclusiveMaximum": f"must be less than {limit}",
        "enum": f"must be one of {', '.join(map(str, limit)) if isinstance(limit, list) else limit}",
        "const": f"must be {limit!r}",
        "minItems": f"needs at least {limit} entries",
        "maxItems": f"may have at most {limit} entries",
        "minLength": "must not be empty",
    }
    text = words.get(
        error.validator, error.message if len(error.message) < 160 else "does not fit the format"
    )
    return f"{text}, found {found}"
