"""A laboratory's own effects: registered from Python, or by files that SRS_OPT_EFFECTS names."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import inspect
import os
import re
import sys
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from srs_opt.errors import InputError

if TYPE_CHECKING:
    from srs_opt.model.effects.effect import Effect

VARIABLE = "SRS_OPT_EFFECTS"
KINDS = ("actuation", "body", "ground", "tether", "room", "measurement")
_own: dict[str, Effect] = {}


def own_effects() -> dict[str, Effect]:
    """Return the registered effects by name, in the order of their registration."""
    _load_files(os.environ.get(VARIABLE, ""))
    return dict(_own)


def add(effect: Effect, built_in: set[str]) -> None:
    """Keep `effect`; see `srs_opt.model.effects.register_effect`."""
    name = effect.name
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"effect '{name}': expected a name of lower-case letters, digits and underscores")
    if name in built_in:
        raise InputError(f"effect '{name}' exists already; choose another name")
    if effect.kind not in KINDS:
        raise InputError(f"effect '{name}': kind must be one of {', '.join(KINDS)}, found '{effect.kind}'")
    if not effect.parameters or effect.parameters[0].place:
        raise InputError(f"effect '{name}': its first parameter must be a size whose zero means absence")
    if name in _own and definition(_own[name]) != definition(effect):
        raise InputError(f"effect '{name}' was registered before with another definition")
    _own[name] = effect


def definition(effect: Effect) -> str:
    """Return a hash that changes with the effect's parameters and with the file that defines its hooks."""
    digest = hashlib.sha256()
    for field in dataclasses.fields(effect):
        value = getattr(effect, field.name)
        if not callable(value):
            digest.update(f"{field.name}={value!r};".encode())
            continue
        digest.update(f"{field.name}:".encode())
        code = value.__code__
        constants = [c for c in code.co_consts if isinstance(c, (int, float, str, type(None)))]
        digest.update(code.co_code + repr(constants).encode())
        source = inspect.getsourcefile(value)
        if source and Path(source).is_file():
            digest.update(Path(source).read_bytes())
    return digest.hexdigest()[:16]


@lru_cache(maxsize=8)
def _load_files(files: str) -> None:
    """Run every file of a list as PATH's (they call register_effect); worker processes inherit the list."""
    for number, file in enumerate(filter(None, files.split(os.pathsep))):
        name = f"srs_opt_own_effects_{number}"
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None or not Path(file).is_file():
            raise InputError(f"{VARIABLE}: {file}: expected a Python file that calls register_effect")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"{VARIABLE}: {file}: {type(error).__name__}: {error}") from error
