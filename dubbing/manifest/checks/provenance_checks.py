"""Can a dub be marked and signed as its manifest asks: keys, certificates, the film's credentials.

`dfrf plan` finds it out before any work.
"""

from pathlib import Path

from dubbing.engine.disk.numbered import plain
from dubbing.errors import ExplainedError
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.findings import Findings
from dubbing.manifest.keys.yaml_lines import KeyPath
from dubbing.media import SUFFIX
from dubbing.packages import missing_of
from dubbing.provenance import credentials
from dubbing.provenance.mark_key import HOMELESS, REMEDY, installation_file, read_key
from dubbing.provenance.signer import Signer


def signer_of(dub: Dub) -> Signer | None:
    """Who signs a dub; None where nobody does."""
    return Signer(dub.certificate, dub.key) if dub.certificate and dub.key else None


def inspect_keys(findings: Findings, at: KeyPath, dub: Dub) -> None:
    """The keys that mark and sign a dub."""
    if dub.mark is not None and dub.mark.key is not None:
        try:
            read_key(dub.mark.key)
        except ExplainedError as error:
            findings.add((*at, "mark", "key"), str(error))
    if (signer := signer_of(dub)) is not None:
        if problem := credentials.problem(signer, SUFFIX[dub.codec]):
            findings.add((*at, "certificate"), problem)
    elif dub.certificate or dub.key:
        findings.add((*at, "key"), "to sign needs both, certificate and key")
    if dub.mark is not None and dub.mark.key is None and installation_file() is None:
        findings.warn(f"{HOMELESS}: dub will refuse it; {REMEDY}")


def inspect_film(findings: Findings, at: KeyPath, dub: Dub, film: Path) -> None:
    """Warn of or refuse a signed dub over a film whose own credentials do not hold."""
    if signer_of(dub) is None or missing_of("c2pa"):
        return
    problem, prevents = credentials.film_problem(film)
    if prevents:
        message = (
            f"{plain(film).name} cannot be signed over, {problem}: give the film as it was signed"
        )
        findings.add((*at, "certificate"), f"{message}, or leave certificate and key out")
    elif problem:
        what = f"{dub.name} is signed over {plain(film).name}, though {problem}"
        findings.warn(f"{what}; its credentials will record that")
