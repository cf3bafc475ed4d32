"""Commands of lips: `curves` out, `closures` in."""

from dubbing import packages
from dubbing.cli.arguments import ManifestPath, Only, print_line


def curves(manifest: ManifestPath, only: Only = None) -> None:
    """Write what is heard of the lips of every dub, as NAME.curves.csv."""
    packages.require()
    from dubbing.batch.curves import write_curves
    from dubbing.manifest.manifest import load

    for path in write_curves(load(manifest), tuple(only or ())):
        print_line(str(path))


def closures(manifest: ManifestPath, only: Only = None) -> None:
    """Shut mouths that stay open on p, b or m of the words of lines: keys in NAME.edits.yaml."""
    packages.require()
    from dubbing.batch.closures import write_closures
    from dubbing.manifest.manifest import load

    for said in write_closures(load(manifest), tuple(only or ())):
        print_line(said)
