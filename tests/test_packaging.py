"""What is installed is what lies in the folders."""

import tomllib
from fnmatch import fnmatch
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).parent.parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_every_package_is_installed():
    folders = {path.parent for path in (ROOT / "mocapidx").rglob("__init__.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert set(SETTINGS["tool"]["setuptools"]["packages"]) == names | {"mocapidx_cli"}


def test_every_data_file_of_a_package_is_installed():
    patterns = SETTINGS["tool"]["setuptools"]["package-data"]
    for path in (ROOT / "mocapidx").rglob("*"):
        if path.is_dir() or path.suffix in {".py", ".pyc", ".c", ".h", ".so", ".pyd"}:
            continue
        owner = next(folder for folder in path.parents if (folder / "__init__.py").exists())
        package = ".".join(owner.relative_to(ROOT).parts)
        inside = path.relative_to(owner).as_posix()
        assert any(fnmatch(inside, pattern) for pattern in patterns.get(package, [])), path


def test_every_dependency_tells_its_reason_and_its_oldest_version():
    lines = (ROOT / "pyproject.toml").read_text().splitlines()
    project = SETTINGS["project"]
    wanted = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    for dependency in wanted:
        line = next(line for line in lines if f'"{dependency}"' in line)
        assert ">=" in dependency
        assert "  # " in line, dependency


def test_no_source_reads_pickles_or_runs_text():
    forbidden = ("pickle.load", "yaml.", "eval(", "exec(", "allow_pickle=True", "shell=True")
    for path in [*(ROOT / "mocapidx").rglob("*.py"), *(ROOT / "cli").rglob("*.py")]:
        text = path.read_text()
        assert not [word for word in forbidden if word in text], path
