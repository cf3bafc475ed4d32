"""Which code makes a result: a digest of a module and of everything of ours that it imports.

A stage whose equations change is out of date by itself. A comment, a docstring or the layout of a
line changes no digest; another minor version of Python may.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

OURS = ("dfrf", "dubbing")
WITHOUT_EFFECT = ("dubbing.errors",)  # words for people: no result depends on them


@lru_cache(maxsize=64)
def code_version(module: str) -> str:
    """Digest of a module, named as Python imports it, with all that it imports of our packages.

    Imports inside of functions count. Nothing is executed.
    """
    hasher = hashlib.blake2b(digest_size=16)
    for name in sorted(_reachable(module)):
        hasher.update(f"{name}\n{_parsed(name)[0]}\n".encode())
    return hasher.hexdigest()


def _reachable(module: str) -> set[str]:
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found and name not in WITHOUT_EFFECT:
            found.add(name)
            waiting += _parsed(name)[1]
    return found


@lru_cache(maxsize=1024)
def _parsed(module: str) -> tuple[str, tuple[str, ...]]:
    """Digest of one module's code, and the modules of ours that it imports."""
    path = _file(module)
    assert path is not None, module
    tree = ast.parse(path.read_bytes())
    imported = tuple(dict.fromkeys(_imported(tree)))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and _documented(node):
            node.body = node.body[1:]
    return hashlib.blake2b(ast.dump(tree).encode(), digest_size=16).hexdigest(), imported


def _imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            # What is imported from a package is one of its modules, or comes from its __init__.
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        yield from (n for n in names if n.split(".")[0] in OURS and _file(n) is not None)


def _documented(node: ast.Module | ast.ClassDef | ast.FunctionDef) -> bool:
    return ast.get_docstring(node, clean=False) is not None


@lru_cache(maxsize=4096)
def _file(module: str) -> Path | None:
    """Source of a module or package of ours; None where there is no such module."""
    package, *rest = module.split(".")
    spec = find_spec(package)
    assert spec is not None
    assert spec.submodule_search_locations
    base = Path(next(iter(spec.submodule_search_locations)), *rest)
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.is_file():
            return path
    return None
