"""What every command has in common: options, exit status, progress, JSON on stdout.

A command module defines ``build_parser`` and ``run(options) -> Answer`` and calls
``main = command(...)``; it parses, calls the library and prints, nothing else.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from srs_opt.errors import InputError, NoAnswerError, SrsError
from srs_opt.files import check_can_write

if TYPE_CHECKING:
    from srs_opt.robot import Robot

T = TypeVar("T")
MODELS = ("complex", "simplified", "compliant")  # those of the library; model.registry has them all
FAULT = 70  # exit status of a bug (EX_SOFTWARE); 0, 1 and 2 are answers


@dataclass(frozen=True)
class Answer:
    """What a command found: the JSON object, the words for a person, and whether it is a good answer."""

    record: dict[str, Any]
    summary: str
    good: bool = True
    files: tuple[Path, ...] = field(default=())


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line."""

    out_may_be_a_file = False  # whether --out may name the answer's file, which may exist

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        # argparse before Python 3.14 takes -5e-2 for an option
        self._negative_number_matcher = re.compile(r"^-(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?$")

    def error(self, message: str) -> NoReturn:
        """Report bad usage on one line and exit with status 2."""
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def make_parser(
    prog: str, description: str, example: str, *, robot: bool = True, sweep: bool = False
) -> Parser:
    """Return a parser with the options that all commands share."""
    parser = Parser(
        prog=prog,
        description=description,
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    if robot:
        parser.add_argument(
            "--robot", type=Path, metavar="FILE", help="robot file (default: the built-in WPI SRS)"
        )
        add_model(parser)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the files (default: out/<command>)"
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object on stdout and nothing else there"
    )
    parser.add_argument(
        "--plugin",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.py",
        help="Python file that defines effects, objectives or planners of your own; it is run (repeat "
        "for several)",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress, no messages")
    parser.add_argument(
        "--seed", type=seed_number, default=0, metavar="N", help="seed of all randomness (default 0)"
    )
    if sweep:
        parser.add_argument(
            "--jobs",
            type=positive_int,
            default=os.cpu_count() or 1,
            metavar="N",
            help="processes (default: all cores)",
        )
        parser.add_argument(
            "--cluster", metavar="ADDRESS", help="Dask scheduler to send the work to, host:port"
        )
    return parser


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the dynamic model."""
    parser.add_argument(
        "--model",
        metavar="NAME",
        help=f"dynamic model: {', '.join(MODELS)}, or one that a --plugin defines (default: compliant where "
        "the robot file has a stiffness, else complex)",
    )


def add_valve_limits(parser: argparse._ActionsContainer) -> None:
    """Add what a valve pattern must keep to, and on which tick it stands."""
    add = parser.add_argument
    add("--max-curvature", type=positive_float, metavar="1_M", help="largest curvature, 1/m")
    add(
        "--min-dwell", type=positive_float, default=0.02, metavar="S",
        help="least time between switches of a valve, s (default 0.02)",
    )  # fmt: skip
    add(
        "--tick", type=positive_float, default=0.001, metavar="S", help="controller's tick, s (default 0.001)"
    )


def _check_model(name: str | None) -> None:
    """Refuse a model that is not known, before anything slow."""
    if name is not None and name not in MODELS:
        from srs_opt.document import unknown_word
        from srs_opt.errors import InputError
        from srs_opt.registry import own_names

        if name not in (own := own_names("model")):
            raise InputError(f"--model: {unknown_word('model', name, [*MODELS, *own])}")


def chosen_model(options: argparse.Namespace, robot: Robot) -> str:
    """Return the model that --model names, else the robot's own."""
    return str(options.model or robot.own_model)


def run_command(
    parser: Parser, run: Callable[[argparse.Namespace], Answer], argv: list[str] | None = None
) -> int:
    """Parse, run, print; return the exit status (0 done, 1 no good answer, 2 bad input).

    No traceback reaches a user; with SRS_OPT_TRACEBACK set, that of a bug does.
    """
    _ready_streams()
    _end_on_sigterm()
    os.environ["MPLBACKEND"] = "agg"  # commands draw into files; a backend that is not there would stop them
    options = parser.parse_args(argv)
    try:
        if options.out is None:
            options.out = Path("out") / parser.prog.split()[-1].split(".")[-1]
        check_can_write(options.out, or_file=parser.out_may_be_a_file)
        if options.plugin:
            from srs_opt.plugins import load_plugin

            for file in options.plugin:
                load_plugin(file)
        _check_model(getattr(options, "model", None))
        answer = run(options)
        if options.json:
            print(json.dumps(answer.record, allow_nan=False))
        elif not options.quiet:
            print(visible(answer.summary))
            for path in answer.files:
                print(visible(f"  wrote {path}"))
        sys.stdout.flush()
        return 0 if answer.good else 1
    except InputError as error:
        print(f"{parser.prog}: {one_line(error)}", file=sys.stderr)
        return 2
    except (NoAnswerError, SrsError) as error:
        print(f"{parser.prog}: {one_line(error)}", file=sys.stderr)
        if options.json:
            print(json.dumps({"error": one_line(error)}))
        return 1
    except KeyboardInterrupt:
        print(f"\n{parser.prog}: interrupted; no incomplete file was left behind", file=sys.stderr)
        return 130
    except Terminated:
        print(f"{parser.prog}: terminated; no incomplete file was left behind", file=sys.stderr)
        return 143
    except BrokenPipeError:
        _close_output()
        return 141
    except OSError as error:
        _close_output()
        print(f"{parser.prog}: {error.filename or 'output'}: {error.strerror or error}", file=sys.stderr)
        return 2
    except MemoryError as error:
        print(
            f"{parser.prog}: out of memory ({one_line(error) or 'no detail'}); "
            "ask for something shorter, smaller or coarser",
            file=sys.stderr,
        )
        return 2
    except Exception as error:
        if os.environ.get("SRS_OPT_TRACEBACK"):
            raise
        if isinstance(error, ModuleNotFoundError) and not _is_own(error.name):
            print(f"{parser.prog}: {_missing_package(error.name)}", file=sys.stderr)
            return 2
        print(
            f"{parser.prog}: internal error, {type(error).__name__}: {one_line(error)[:300]} "
            "(please report it; SRS_OPT_TRACEBACK=1 shows where)",
            file=sys.stderr,
        )
        return FAULT


class Terminated(BaseException):
    """SIGTERM came: what is under way is cleared up, as after Ctrl-C."""


def _end_on_sigterm() -> None:
    """Let SIGTERM unwind the program, so that temporary files and child processes go with it."""
    import signal
    import threading

    def end(number: int, frame: Any) -> NoReturn:
        raise Terminated

    ours = threading.current_thread() is threading.main_thread()
    if ours and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, end)


def _is_own(module: str | None) -> bool:
    """Whether a module that is missing should have been part of this project: then that is a bug."""
    return module is None or module.partition(".")[0] in {"srs_opt", "planners"}


def _missing_package(module: str | None) -> str:
    """Return what to do about a package that this Python lacks."""
    package = str(module).partition(".")[0]
    return (
        f"the Python that runs this, {sys.executable}, has no package '{package}': activate the environment "
        "that has it ('. .venv/bin/activate' in the project's folder, after 'make run'), or install it: "
        "'pip install .' in that folder"
    )


def _ready_streams() -> None:
    """Make sure that words can be printed: streams closed at the start, or without some character."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115  # as long as we run
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a name in another alphabet is no reason to fail


def _close_output() -> None:
    """Send what is still in the buffer nowhere, so that the interpreter does not complain at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def one_line(error: BaseException) -> str:
    """Return the message of `error` on a single line."""
    return visible(" ".join(str(error).split()))


def visible(text: str) -> str:
    """Return `text` with control characters written out: a name in a file must not steer the terminal."""
    return "".join(c if c in "\n\t" or unicodedata.category(c) != "Cc" else f"\\x{ord(c):02x}" for c in text)


def say(options: argparse.Namespace, message: str) -> None:
    """Tell the person something on stderr, unless --quiet."""
    if not options.quiet:
        print(visible(message), file=sys.stderr, flush=True)


def progress(
    items: Iterable[T], options: argparse.Namespace, what: str, total: int | None = None
) -> Iterator[T]:
    """Iterate with a progress bar on stderr (none with --quiet)."""
    from tqdm import tqdm

    yield from tqdm(
        items, desc=what, total=total, disable=options.quiet or None, file=sys.stderr, leave=False
    )


def one_thread_of_linear_algebra() -> None:
    """Keep NumPy to one thread, unless the user has said otherwise; call it before NumPy is imported.

    Processes share the cores already; threads of the linear algebra would only get in their way.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")


def positive_int(text: str) -> int:
    """Parse a whole number above zero."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number above 0, found '{text}'")
    return value


def seed_number(text: str) -> int:
    """Parse a whole number, zero or above."""
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"expected a whole number from 0, found '{text}'")
    return int(text)


def finite_float(text: str) -> float:
    """Parse a finite number."""
    import math

    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, found '{text}'")
    return value


def positive_float(text: str) -> float:
    """Parse a number above zero."""
    value = finite_float(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"expected a number above 0, found '{text}'")
    return value
