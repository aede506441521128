"""Plugins: files that the command line names with --plugin, and entry points of installed packages.

A plugin registers what it defines when it is run (`srs_opt.effects.register_effect`, `register_planner`,
and whatever has a `srs_opt.registry.Registry`: models, objectives, instruments, judges). A robot file may
say which plugins it needs; loading it never runs one.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from srs_opt.errors import InputError, SrsError

MODULE_PREFIX = "srs_opt_plugin_"
_loaded: dict[str, Path] = {}
_running: list[str] = []


def load_plugin(path: Path | str) -> str:
    """Run a plugin file, once, and return its name (the file's).

    Raises
    ------
    InputError
        If it is no Python file, fails, or shares its name with another plugin.
    """
    file = Path(path).resolve()
    name = file.name
    if name in _loaded:
        if _loaded[name] != file:
            raise InputError(f"--plugin {path}: another plugin is called {name} too; rename one")
        return name
    module_name = MODULE_PREFIX + file.stem
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise InputError(f"--plugin {path}: expected a Python file, which will be run")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    _running.append(name)
    try:
        spec.loader.exec_module(module)
    except SrsError:
        raise
    except Exception as error:
        place = f" (line {line})" if (line := _line_in(error, file)) else ""
        raise InputError(f"--plugin {path}: {type(error).__name__}: {error}{place}") from error
    finally:
        _running.pop()
    _loaded[name] = file
    return name


def _line_in(error: Exception, file: Path) -> int | None:
    """Return the line of the plugin at which it failed."""
    if isinstance(error, SyntaxError):
        return error.lineno
    trace, line = error.__traceback__, None
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(file):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


def running() -> str | None:
    """Return the name of the plugin that is being run, None outside of any."""
    return _running[-1] if _running else None


def loaded() -> tuple[str, ...]:
    """Return the names of the plugin files that were run."""
    return tuple(_loaded)


def files() -> tuple[Path, ...]:
    """Return the plugin files that were run, for other processes to run them too."""
    return tuple(_loaded.values())


def entry_points(group: str) -> Iterator[tuple[str, Any]]:
    """Yield (name of the installed package, what it offers) of every entry point of a group.

    Raises
    ------
    InputError
        If one cannot be loaded.
    """
    for point in importlib.metadata.entry_points(group=group):
        package = point.dist.name if point.dist is not None else point.module
        _running.append(package)
        try:
            yield package, point.load()
        except SrsError:
            raise
        except Exception as error:
            raise InputError(
                f"installed package '{package}', entry point {group} {point.name}: "
                f"{type(error).__name__}: {error}"
            ) from error
        finally:
            _running.pop()


def digest(functions: Iterable[Callable[..., Any]], *more: str) -> str:
    """Return a hash that changes with the code of `functions` and with the files that define them."""
    found = hashlib.sha256(" ".join(more).encode())
    for function in functions:
        found.update(b"hook")
        code = getattr(function, "__code__", None)
        if code is None:  # an object that can be called
            found.update(repr(function).encode())
            continue
        constants = [c for c in code.co_consts if isinstance(c, (int, float, str, type(None)))]
        enclosed = [cell.cell_contents for cell in function.__closure__ or ()]
        found.update(code.co_code + repr((constants, enclosed) if enclosed else constants).encode())
        source = inspect.getsourcefile(function)
        if source and Path(source).is_file():
            found.update(Path(source).read_bytes())
    return found.hexdigest()[:16]


def dumped(value: Any, functions: Iterable[Callable[..., Any]]) -> bytes:
    """Return `value` pickled, its `functions` by value, for processes that cannot import them."""
    import cloudpickle

    modules = {getattr(function, "__module__", None) for function in functions}
    by_value = [sys.modules[m] for m in modules if m in sys.modules and m.split(".")[0] not in _SHARED]
    for module in by_value:
        cloudpickle.register_pickle_by_value(module)
    try:
        return bytes(cloudpickle.dumps(value))
    finally:
        for module in by_value:
            cloudpickle.unregister_pickle_by_value(module)


_SHARED = ("__main__", "srs_opt", "planners", "casadi")  # main is by value anyway, the others are installed
