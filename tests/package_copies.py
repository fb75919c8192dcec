"""Copies of the package, whole or with one line broken, that run with the compiled code they share.

numba keeps compiled code beside the source and takes it only while time and size of the source are
those it was compiled from. A copy that keeps the times keeps the compiled code. Compiled code holds
what it calls, so that breaking a file makes the code of all that import it stale; numba would not
notice, and :func:`forget_compiled` removes it.
"""

import ast
import shutil
from pathlib import Path

import dnacheck
from dnacheck.model.data_files import data_directory
from dnacheck.validation.scene.scene import scenes_directory


def copy_package(folder):
    """The package with its data, scenes and compiled code below ``folder``."""
    source = Path(dnacheck.__file__).parent
    shutil.copytree(source, folder / "dnacheck", ignore=shutil.ignore_patterns("*.pyc", "*.tmp*"))
    for directory, name in ((data_directory(), "data"), (scenes_directory(), "scenes")):
        if not (folder / "dnacheck" / name).exists():
            shutil.copytree(directory, folder / "dnacheck" / name)
    return folder


def replace(folder, file, old, new):
    """Put ``new`` for ``old`` in a file of the copy; compiled code that holds it is removed."""
    path = folder / file
    text = path.read_text()
    assert text.count(old) == 1, f"{file} has changed: {old!r} occurs {text.count(old)} times"
    path.write_text(text.replace(old, new))
    if path.suffix == ".py":
        forget_compiled(folder, _module(folder, path))


def _module(folder, path):
    parts = path.relative_to(folder).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported(path):
    """Names of modules that a file may import, inside functions too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def users_of(folder, module):
    """The module and every module that imports it, directly or by way of others."""
    modules = {_module(folder, path): path for path in folder.rglob("*.py")}
    imported = {name: _imported(path) for name, path in modules.items()}
    users = {module}
    while True:
        more = {name for name in modules if imported[name] & users} - users
        if not more:
            return {name: modules[name] for name in users}
        users |= more


def forget_compiled(folder, module):
    """Remove the compiled code of a module and of all that use it."""
    for path in users_of(folder, module).values():
        for cached in (path.parent / "__pycache__").glob(f"{path.stem}.*.nb?"):
            cached.unlink(missing_ok=True)
