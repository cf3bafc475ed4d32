"""Digest of the code that makes a result: of a module, and of what it imports of some packages.

A stage whose equations change is out of date by itself. A comment, a docstring, the layout of a
line or an import for type checkers changes no digest; another minor version of Python may.
"""

import ast
import hashlib
import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib.util import find_spec, resolve_name
from pathlib import Path

from ..disk.unchanged import while_unchanged

Names = tuple[str, ...]
# Fields of syntax nodes that hold statements, or what these lie in.
BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")


@lru_cache(maxsize=64)
def code_version(module: str, packages: Names = (), without: Names = ()) -> str:
    """Digest of a module, named as Python imports it, with all that it imports of packages.

    Imports inside of functions count. Nothing is executed.

    Args:
        packages: top packages whose modules count.
        without: modules that do not count, with all that lies in them.
    """
    hasher = hashlib.blake2b(digest_size=16)
    for name in sorted(reachable(module, packages, without)):
        hasher.update(f"{name}\n{_parsed(name)[0]}\n".encode())
    return hasher.hexdigest()


def reachable(module: str, packages: Names, without: Names = ()) -> set[str]:
    """A module and all modules that it imports of packages; see `code_version`."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found and not _lies_in(name, without):
            found.add(name)
            named = (one for one in _parsed(name)[1] if one.split(".")[0] in packages)
            waiting += [one for one in named if file_of(one) is not None]
    return found


def _lies_in(name: str, modules: Names) -> bool:
    return any(name == module or name.startswith(f"{module}.") for module in modules)


@lru_cache(maxsize=1024)
def _parsed(module: str) -> tuple[str, Names]:
    """Digest of one module's code, and the names that it imports, of modules or from them."""
    path = file_of(module)
    assert path is not None, module
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    digest, named = _read(path)
    return digest, tuple(resolve_name(name, package) for name in named)


@while_unchanged(1024, kept=tuple[str, list[str]])
def _read(path: Path) -> tuple[str, list[str]]:
    """Digest of the code in a file, and the names that it imports, relative ones as they are."""
    tree = ast.parse(path.read_bytes())
    imported: dict[str, None] = {}
    waiting: list[ast.AST] = [tree]
    while waiting:  # statements alone: expressions hold no imports
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom):
            imported |= dict.fromkeys(_imported(node))
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            documented = ast.get_docstring(node, clean=False) is not None
            node.body = node.body[1:] if documented else node.body
        for block in BLOCKS:
            if inner := getattr(node, block, None):
                inner[:] = [one for one in inner if not _for_type_checkers(one)]
                waiting += inner
    return hashlib.blake2b(ast.dump(tree).encode(), digest_size=16).hexdigest(), list(imported)


def _for_type_checkers(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


def _imported(node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    """Names that an import statement imports."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    else:
        # What is imported from a package is one of its modules, or comes from its __init__.
        base = "." * node.level + (node.module or "")
        yield base
        yield from (f"{base}{'.' * bool(node.module)}{alias.name}" for alias in node.names)


@lru_cache(maxsize=4096)
def file_of(module: str) -> Path | None:
    """Source of a module or package; None where there is no such file."""
    top, *rest = module.split(".")
    spec = find_spec(top) if top not in sys.builtin_module_names else None
    if spec is None:
        return None
    if not spec.submodule_search_locations:
        alone = Path(spec.origin or "")
        return alone if alone.suffix == ".py" and not rest else None
    base = Path(next(iter(spec.submodule_search_locations)), *rest)
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.is_file():
            return path
    return None
