"""Every command and code block of README and docs runs and gives what the page shows."""

import ast
import doctest
import os
import subprocess
import sys
from pathlib import Path

import pytest
from blocks import Block, blocks, commands, same_line, same_output

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
SHOWN_ONLY = {"", "text", "toml", "csv", "json", "c", "mermaid", "yaml", "html", "make"}
ACTIVATE = ".venv/bin/activate"
SLOW_PAGES = {"README.md", "tutorial.md", "measure.md", "commands.md", "maze.md"}


class Tolerant(doctest.OutputChecker):
    """Numbers to 5 %."""

    def check_output(self, want, got, optionflags):
        shown, real = want.rstrip().splitlines(), got.rstrip().splitlines()
        return super().check_output(want, got, optionflags) or (
            len(shown) == len(real) and all(map(same_line, shown, real))
        )


@pytest.fixture
def desk(tmp_path, monkeypatch) -> Path:
    """A folder to work in that looks like the project's to the commands."""
    for name in ("mazes", "examples", "virtual_lab", "docs", "firmware"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    own = Path(sys.executable).parent
    if sys.prefix != sys.base_prefix:  # a shell in which nobody has activated the environment
        rest = [folder for folder in os.environ["PATH"].split(os.pathsep) if Path(folder) != own]
        monkeypatch.setenv("PATH", os.pathsep.join(rest))
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ACTIVATE).write_text(f'export PATH="{own}{os.pathsep}$PATH"\n', encoding="utf-8")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setenv("COLUMNS", "100")
    return tmp_path


def run_console(block: Block, monkeypatch) -> None:
    for command, status, shown in commands(block):
        if command == f". {ACTIVATE}":  # holds for the rest of the page
            path = subprocess.run(
                ["bash", "-c", f'{command} && printf %s "$PATH"'], capture_output=True, text=True, check=True
            )
            monkeypatch.setenv("PATH", path.stdout)
            continue
        done = subprocess.run(
            ["bash", "-c", command], capture_output=True, text=True, timeout=550, check=False
        )
        told = f"line {block.line}: {command}\n{done.stdout}{done.stderr}"
        assert done.returncode == status, told
        real = (done.stdout if status < 2 else done.stderr).rstrip("\n").splitlines()
        assert same_output(shown, real), f"{told}\n--- the page shows ---\n" + "\n".join(shown)


def run_python(block: Block, names: dict) -> None:
    if ">>>" not in block.text:
        exec(compile(block.text, f"block at line {block.line}", "exec"), names)
        return
    test = doctest.DocTestParser().get_doctest(block.text, names, "page", "page", block.line)
    runner = doctest.DocTestRunner(Tolerant(), verbose=False, optionflags=doctest.ELLIPSIS)
    told: list[str] = []
    runner.run(test, out=told.append, clear_globs=False)
    assert not runner.failures, "".join(told)
    names.update(test.globs)


def page_id(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=pytest.mark.slow if p.name in SLOW_PAGES else ()) for p in PAGES],
    ids=page_id,
)
def test_blocks_of_a_page(page, desk, monkeypatch):
    names: dict = {"__name__": "page"}
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.file:
            (desk / block.file).write_text(block.text, encoding="utf-8")
        elif block.skip is not None:
            assert block.skip, f"{page.name}:{block.line}: a skipped block needs a reason"
        elif block.language in ("console", "bash"):
            run_console(block, monkeypatch)
        elif block.language == "python":
            run_python(block, names)
        else:
            assert block.language in SHOWN_ONLY, f"{page.name}:{block.line}: {block.language} is not tested"


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_a_page_activates_the_environment_before_its_commands(page):
    typed = [
        command
        for block in blocks(page.read_text(encoding="utf-8"))
        if block.language in ("console", "bash")
        for command, _, _ in commands(block)
        if not command.startswith("make ")
    ]
    assert not typed or page.name == "CONTRIBUTING.md" or typed[0] == f". {ACTIVATE}"


def test_readme_is_short():
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    assert 20 < len(lines) < 200


@pytest.mark.parametrize(
    ("shown", "real", "same"),
    [
        (["speed 0.231 m/s in 3.2 s"], ["speed 0.232 m/s in 9.9 s"], True),
        (["speed 0.231 m/s"], ["speed 0.331 m/s"], False),
        (["12 trials"], ["13 trials"], False),
        (["a ..."], ["a b 3"], True),
        (["...", "last"], ["x", "y", "last"], True),
        (["...", "last"], ["x", "y"], False),
        (["one"], ["one", "two"], False),
        (["one", "..."], ["one", "two"], True),
        ([], ["anything"], True),
    ],
)
def test_comparison(shown, real, same):
    assert same_output(shown, real) is same


@pytest.mark.slow
def test_docs_build_without_a_warning(tmp_path):
    pytest.importorskip("mkdocs", reason="the extra 'docs' is not installed")
    pytest.importorskip("mkdocstrings", reason="the extra 'docs' is not installed")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "mkdocs", "build", "--strict", "--quiet", "-d", tmp_path],
        cwd=ROOT,
        # colouring sources, and a formatter's process for each signature, take as long as all the rest
        env={**os.environ, "DOCS_SHOW_SOURCE": "false", "DOCS_SEPARATE_SIGNATURE": "false"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "index.html").stat().st_size > 5000
    pages = {page: page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html")}
    assert not [page for page, text in pages.items() if "Could not collect" in text]
    reference = "".join(text for page, text in pages.items() if page.parent.name == "reference")
    assert not [name for name in public_names() if f'id="{name}"' not in reference]


def public_names() -> list[str]:
    """Return the full name of every public function and class of the packages, commands' own apart."""
    found = []
    for file in (file for package in ("srs_opt", "planners") for file in (ROOT / package).rglob("*.py")):
        if file.name == "__main__.py":
            continue
        module = ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        body = ast.parse(file.read_text(encoding="utf-8")).body
        defined = [x.name for x in body if isinstance(x, ast.FunctionDef | ast.ClassDef)]
        found += [f"{module}.{name}" for name in defined if not name.startswith("_")]
    assert len(found) > 300
    return found
