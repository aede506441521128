"""Data flows one way: a module imports from its own layer or from those below it, never from above."""

import ast
from functools import lru_cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# From the bottom up. A module belongs to the longest prefix that fits it.
LAYERS = (
    (
        "srs_opt",
        "planners",
        "srs_opt.errors",
        "srs_opt.interrupts",
        "srs_opt.plugins",
        "srs_opt.callable_package",
    ),
    ("srs_opt.files", "srs_opt.parallel"),
    ("srs_opt.document", "srs_opt.figures", "srs_opt.command", "srs_opt.result"),
    ("srs_opt.problem", "srs_opt.table"),
    ("srs_opt.robot", "srs_opt.robots"),
    ("srs_opt.gait", "srs_opt.model"),
    ("srs_opt.simulate",),
    ("srs_opt.orbit",),
    ("srs_opt.simulate.run", "srs_opt.simulate.figures", "srs_opt.simulate.export"),
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
    # a geometric path is followed as the drive does it, hence so high
    (
        "planners.plan",
        "planners.refine",
        "planners.drive",
        "planners.view",
        "planners.search.follow",
        "planners.search.ompl_geometric",
    ),
    ("planners.benchmark", "planners.pilot"),
)
# a robot file names effects, so the catalogue of effects checks that part of the file
ALLOWED = {
    ("srs_opt.robot", "srs_opt.model.effects"),
    ("srs_opt.robot", "srs_opt.model.effects.entries"),
    ("srs_opt.robot", "srs_opt.model.effects.plugins"),
}
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


def layer(module: str) -> int:
    fits = [
        (len(prefix), index)
        for index, prefixes in enumerate(LAYERS)
        for prefix in prefixes
        if module == prefix or (module.startswith(prefix + ".") and prefix not in ("srs_opt", "planners"))
    ]
    assert fits, f"{module} has no layer: add its package to LAYERS"
    return max(fits)[1]


@pytest.mark.parametrize("module", sorted(m for m in imports() if not is_command(m)))
def test_imports_go_down(module):
    up = {
        target
        for target in imports()[module]
        if (module, target) not in ALLOWED and not is_command(target) and layer(target) > layer(module)
    }
    assert not up, f"{module} imports from layers above its own: {sorted(up)}"


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
            for target in imports()[module] - {t for m, t in ALLOWED if m == module}:
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
