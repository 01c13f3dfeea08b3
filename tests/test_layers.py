"""Imports point up the layout only, and each heavy library has its one home."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / "mocapidx"
CLI = Path(__file__).parent.parent / "cli"

LAYERS = (
    *("errors", "printable", "markup", "model", "units", "toml_files", "kernels", "durable"),
    *("transcripts", "formats", "skeleton", "features", "segments", "alignment", "store"),
    *("index", "queries", "templates", "graphs", "synthesis", "evaluation", "reports", "tasks"),
    "__init__",
)
LEVEL = {name: level for level, name in enumerate(LAYERS)}
ALLOWED = {
    "click": {"cli"},
    "tqdm": {"cli"},
    "h5py": {"store"},
    "pyroaring": {"index", "queries"},
    "matplotlib": {"reports"},
    "dask": {"tasks"},
    "distributed": {"tasks"},
}


def imported_modules(path):
    """Every module that a file names in an import, imports inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def part_of(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_point_upwards_in_the_layout(path):
    part = part_of(path)
    for name in imported_modules(path):
        top = name.split(".")[0]
        assert part in ALLOWED.get(top, {part}), f"{part} imports {name}"
        assert top != "mocapidx_cli", f"{part} imports {name}"
        if name.startswith("mocapidx.") and name.split(".")[1] in LEVEL:
            assert LEVEL[name.split(".")[1]] <= LEVEL[part], f"{part} imports {name}"


@pytest.mark.parametrize("path", sorted(CLI.rglob("*.py")), ids=lambda p: p.name)
def test_the_command_line_reaches_the_library_through_tasks(path):
    reachable = {"tasks", "errors", "model", "printable"}
    for name in imported_modules(path):
        assert name.split(".")[0] not in {"cli", "h5py", "pyroaring"}, f"{path.name} imports {name}"
        if name.startswith("mocapidx."):
            assert name.split(".")[1] in reachable, f"{path.name} imports {name}"


def test_every_part_of_the_library_has_its_place_in_the_layout():
    parts = {p.name.removesuffix(".py") for p in ROOT.iterdir() if p.name != "__pycache__"}
    assert {p for p in parts if not p.startswith("py.")} <= set(LAYERS)
