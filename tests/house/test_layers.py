"""Data flows one way: a module imports from its own layer or from those below it, never from above."""

import ast
from functools import lru_cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# From the bottom up: a package imports from the layers below its own, and a layer holds packages that do not
# know each other. A file belongs to its package; no single file has a place of its own.
LAYERS = (
    ("srs_opt.errors", "srs_opt.geometry", "srs_opt.interrupts", "srs_opt.callable_package"),
    ("srs_opt.files", "srs_opt.plugins"),
    ("srs_opt.document", "srs_opt.figures", "srs_opt.parallel", "srs_opt.registry"),
    ("srs_opt.command", "srs_opt.problem", "srs_opt.result"),
    ("srs_opt.table",),
    ("srs_opt.effects", "srs_opt.robots"),
    ("srs_opt.robot",),
    ("srs_opt.gait", "srs_opt.model"),
    ("srs_opt.simulate",),
    ("srs_opt.orbit",),
    ("srs_opt.gait_opt", "srs_opt.gait_map"),
    ("srs_opt.gait_file", "srs_opt.controller"),
    ("srs_opt.judge",),
    ("srs_opt.manoeuvre",),
    ("srs_opt.measurement",),
    ("srs_opt.drive",),
    ("srs_opt.calibrate",),
    ("srs_opt.discrepancy", "srs_opt.report"),
    ("planners.maze", "planners.motion"),
    ("planners.search",),
    ("planners.generate",),
    ("planners.plan",),
    ("planners.refine", "planners.view"),
    ("planners.drive",),
    ("planners.apps",),
    ("planners.benchmark", "planners.pilot"),
)
LONGEST_FILE = 400


def sources() -> list[Path]:
    return sorted([*(ROOT / "srs_opt").rglob("*.py"), *(ROOT / "planners").rglob("*.py")])


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@lru_cache(maxsize=1)
def imports() -> dict[str, set[str]]:
    """Return the project's modules that each module imports, lazily or not (commands are entry points)."""
    known = {module_name(path) for path in sources()}
    found: dict[str, set[str]] = {}
    for path in sources():
        targets: set[str] = set()
        tree = ast.parse(path.read_text(encoding="utf-8"))
        typing_only = {id(n) for test in ast.walk(tree) if _for_types(test) for n in ast.walk(test)}
        for node in ast.walk(tree):
            if id(node) in typing_only:
                continue
            if isinstance(node, ast.Import):
                targets |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inside = {f"{node.module}.{alias.name}" for alias in node.names}
                targets |= (inside & known) or {node.module}
        found[module_name(path)] = targets & known
    return found


def _for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def is_command(module: str) -> bool:
    """Commands parse, call and print; they sit on top of everything."""
    return module.endswith(".__main__") or module == "planners.tour"


def package(module: str) -> str:
    """Return the folder or file right below srs_opt or planners that a module belongs to."""
    return ".".join(module.split(".")[:2])


def layer(module: str) -> int:
    found = [index for index, packages in enumerate(LAYERS) if package(module) in packages]
    assert found, f"{module} has no layer: add its package to LAYERS"
    return found[0]


TOPS = ("srs_opt", "planners")  # front doors: they may name everything, and nothing imports them
LIBRARY = sorted(m for m in map(module_name, sources()) if not is_command(m) and m not in TOPS)


@pytest.mark.parametrize("module", LIBRARY)
def test_imports_go_down(module):
    others = [t for t in imports()[module] if t not in TOPS and package(t) != package(module)]
    up = {target for target in others if is_command(target) or layer(target) >= layer(module)}
    assert not up, f"{module} imports from its own layer or from above: {sorted(up)}"


def test_commands_join_packages_in_one_place():
    """A command of srs_opt reaches what is built upon the library through planners.apps alone."""
    reached = {
        (module, target)
        for module, targets in imports().items()
        if is_command(module) and module.startswith("srs_opt.")
        for target in targets
        if target.startswith("planners.") and package(target) != "planners.apps"
    }
    assert not reached


def test_nothing_imports_a_command():
    users = {
        (module, target)
        for module, targets in imports().items()
        for target in targets
        if is_command(target) and not is_command(module)
    }
    assert not users


def test_no_circular_imports():
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, f"circular: {' -> '.join((*path, module))}"
        if module not in done:
            for target in imports()[module]:
                visit(target, (*path, module))
            done.add(module)

    for module in imports():
        visit(module, ())


@pytest.mark.parametrize(
    "folder", ["srs_opt", "planners", "dart_snake", "virtual_lab", "tests", "examples", "benchmarks", "docs"]
)
def test_files_can_be_read_in_a_sitting(folder):
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines())
        for path in (ROOT / folder).rglob("*.py")
    }
    assert not {name: n for name, n in lengths.items() if n > LONGEST_FILE}


def test_nothing_knows_the_machine():
    """No file of the project names a place that exists on one machine only."""
    places = ("/root/", "/home/", "/work/", "/Users/", "/opt/", "/.library", "/shared/")
    told = []
    for folder in ("srs_opt", "planners", "dart_snake", "virtual_lab", "examples", "docs", "benchmarks"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".py", ".md", ".yaml", ".json", ".html", ".jinja", ".c", ".h"):
                text = path.read_text(encoding="utf-8")
                told += [(path.name, place) for place in places if place in text]
    assert not told
