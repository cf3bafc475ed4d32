"""The stages of a dub, one file each: dependencies, amount of work, and the call that does it.

`dubbing.pipeline` puts them together. Nothing here loads torch before a stage runs.
"""

from pkgutil import iter_modules

# Names of the stages, which are those of their files; nothing of them is imported.
KINDS = tuple(module.name for module in iter_modules(__path__) if module.name != "base")
