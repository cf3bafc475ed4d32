"""Signed content credentials (C2PA): how a file was made, and by whom. Extra ``dfrf[c2pa]``.

The library may ask the network for manifests and revocations that a file names: here it never does.
"""

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

from dubbing.engine.disk.files import atomic_path, read_bounded
from dubbing.engine.disk.numbered import plain
from dubbing.engine.disk.unchanged import while_unchanged
from dubbing.errors import ExplainedError, RenderingError, StageError
from dubbing.packages import lacking, missing_of
from dubbing.provenance.provenance import SOURCE_TYPE, made_by
from dubbing.provenance.signer import Signer

FORMATS = {".mp4": "video/mp4", ".m4v": "video/mp4", ".mov": "video/quicktime"}
MOST_BYTES = 10**6  # of a certificate chain or a key
FILM, DUBBED = "film", "org.dfrf.dub"
UNKNOWN_SIGNER = "signingCredential.untrusted"
OFFLINE = {"verify": {"remote_manifest_fetch": False, "ocsp_fetch": False}}
ALGORITHMS = {"secp256r1": b"es256", "secp384r1": b"es384", "secp521r1": b"es512"}


@dataclass(frozen=True)
class Credentials:
    """The credentials of a file.

    Attributes:
        state: ``Valid``, ``Trusted`` (the root is known, too) or ``Invalid``.
        signed_by: the name in the certificate.
        actions: labels of what was done, ``c2pa.dubbed`` among them.
        dub: the signed data under `DUBBED`; empty where it is not a dub of ours.
        problems: what is wrong, in the words of the library.
        film_problems: what was wrong with the credentials of the film, when this was signed.
        earlier: how many manifests of what went into it are kept.
    """

    state: str
    signed_by: str
    actions: list[str]
    dub: dict[str, Any]
    problems: list[str]
    film_problems: list[str]
    earlier: int


def sign(video: Path, out: Path, signer: Signer, film: Path, facts: Mapping[str, Any]) -> None:
    """Write the video with credentials to ``out``: of the same suffix, .mp4 or .mov.

    Args:
        film: what was dubbed. It becomes an ingredient, with the credentials that it carries.
        facts: plain data of the dub: consent, model, sound.

    Raises:
        StageError: it cannot be signed so.
        RenderingError: the signed file does not read as valid.
    """
    import c2pa

    claim = _claim(out.name, facts)
    ingredient = {"title": film.name, "relationship": "parentOf", "instance_id": FILM}
    kind = FORMATS.get(film.suffix.lower())
    if kind is None:  # no container that could carry credentials
        claim["ingredients"] = [{**ingredient, "format": "application/octet-stream"}]
    try:
        builder = c2pa.Builder(json.dumps(claim), _context())
        if kind is not None:
            with open(film, "rb") as stream:
                builder.add_ingredient_from_stream(json.dumps(ingredient), kind, stream)
        with atomic_path(out) as temporary:
            builder.sign_file(str(video), str(temporary), _signer(signer))
    except c2pa.C2paError as error:
        raise StageError(f"cannot be signed: {error}", str(video), "look at the key") from error
    signed = read(out)
    if signed is None or signed.state == "Invalid":
        why = "; ".join(signed.problems) if signed else "none are in it"
        raise RenderingError(f"its credentials do not hold: {why}", out.name)


def read(path: Path) -> Credentials | None:
    """The credentials in a file; None where there are none.

    Raises:
        StageError: there are some that cannot be read.
    """
    import c2pa

    try:
        reader = c2pa.Reader(str(path), context=_context())
    except (c2pa.C2paError.ManifestNotFound, c2pa.C2paError.NotSupported):
        return None
    except c2pa.C2paError as error:
        raise StageError(f"its credentials cannot be read: {error}", str(path)) from error
    with reader:
        return _parse(json.loads(reader.json()), str(reader.get_validation_state()))


def problem(signer: Signer, suffix: str) -> str:
    """Why no file of that suffix could be signed so; else empty. Signs an image to find out."""
    if gone := missing_of("c2pa"):
        return str(lacking(gone))
    if suffix not in FORMATS:
        return f"{suffix} cannot carry credentials: use codec h264 or prores, or leave both away"
    import c2pa

    try:
        builder = c2pa.Builder(json.dumps(_claim("test", {}, opened=False)), _context())
        signed = io.BytesIO()
        builder.sign(_signer(signer), "image/png", io.BytesIO(_smallest_image()), signed)
        signed.seek(0)
        with c2pa.Reader("image/png", signed, context=_context()) as reader:
            result = _parse(json.loads(reader.json()), str(reader.get_validation_state()))
    except (c2pa.C2paError, ExplainedError) as error:
        return f"cannot sign: {error}"
    return "" if result.state != "Invalid" else f"cannot sign: {'; '.join(result.problems)}"


def _signer(signer: Signer) -> Any:
    import c2pa

    chain, key = (_pem(path) for path in (signer.certificate, signer.key))
    info = c2pa.C2paSignerInfo(_algorithm(key, signer.key), chain, key, None)
    return c2pa.Signer.from_info(info)


def _pem(path: Path) -> bytes:
    try:
        content = read_bounded(path, MOST_BYTES)
    except OSError as error:
        raise StageError(f"cannot be read: {error.strerror}", str(path)) from error
    if b"-----BEGIN" not in content or b"\0" in content:
        raise StageError("is no PEM", str(path), "convert it with openssl")
    return content


def _algorithm(key: bytes, path: Path) -> bytes:
    """C2PA's name of the algorithm that a private key signs with."""
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        loaded = load_pem_private_key(key, password=None)
    except Exception as error:  # one of many kinds; a wrong password is a TypeError
        raise StageError(
            "is no private key in PEM, or one with a password", str(path), "name one without"
        ) from error
    if isinstance(loaded, ed25519.Ed25519PrivateKey):
        return b"ed25519"
    if isinstance(loaded, rsa.RSAPrivateKey):
        return b"ps256"
    if isinstance(loaded, ec.EllipticCurvePrivateKey) and loaded.curve.name in ALGORITHMS:
        return ALGORITHMS[loaded.curve.name]
    raise StageError("a kind of key that C2PA does not know", str(path), "use ES256")


def _claim(title: str, facts: Mapping[str, Any], *, opened: bool = True) -> dict[str, Any]:
    actions: list[dict[str, Any]] = [
        {"action": "c2pa.opened", "parameters": {"ingredientIds": [FILM]}},
        {
            "action": "c2pa.dubbed",
            "softwareAgent": {"name": made_by()},
            "digitalSourceType": SOURCE_TYPE,
        },
    ]
    if not opened:
        actions = [{"action": "c2pa.created", "digitalSourceType": SOURCE_TYPE}]
    return {
        "claim_generator_info": [{"name": made_by()}],
        "title": title,
        "assertions": [
            {"label": "c2pa.actions.v2", "data": {"actions": actions}},
            {"label": DUBBED, "data": dict(facts)},
        ],
    }


def _parse(store: dict[str, Any], state: str) -> Credentials:
    """Credentials of the library's JSON; ``state``: its verdict on them."""
    manifests = store.get("manifests") or {}
    active = manifests.get(store.get("active_manifest")) or {}
    data = {entry["label"]: entry.get("data") for entry in active.get("assertions", [])}
    actions = (data.get("c2pa.actions.v2") or data.get("c2pa.actions") or {}).get("actions", [])
    signature = active.get("signature_info") or {}
    names = (signature.get("common_name"), signature.get("issuer"))
    wrong = [
        entry.get("explanation") or entry["code"] for entry in store.get("validation_status", [])
    ]
    return Credentials(
        state=state,
        signed_by=", ".join(name for name in names if name),
        actions=[action["action"] for action in actions],
        dub=data.get(DUBBED) or {},
        problems=wrong,
        film_problems=_of_ingredients(active.get("ingredients", [])),
        earlier=max(0, len(manifests) - 1),
    )


def _of_ingredients(ingredients: list[dict[str, Any]]) -> list[str]:
    """Why the credentials of ingredients are invalid, but for unknown signers."""
    results = [entry.get("validation_results") or {} for entry in ingredients]
    failures = [
        failure
        for result in results
        for failure in (result.get("activeManifest") or {}).get("failure", [])
        if failure["code"] != UNKNOWN_SIGNER
    ]
    return [failure.get("explanation") or failure["code"] for failure in failures]


@while_unchanged(64)
def film_problem(film: Path) -> tuple[str, bool]:
    """Problem of the credentials of a film that is to be dubbed and signed; '' without one.

    And whether it keeps the dub from being signed. One that reads but does not hold becomes an
    ingredient whose failure is recorded, as C2PA asks of those who sign; see `Credentials`.
    """
    film = plain(film)
    if film.suffix.lower() not in FORMATS:
        return "", False
    try:
        signed = read(film)
    except StageError as error:
        return error.what, True
    if signed is None or signed.state != "Invalid":
        return "", False
    problems = [problem for problem in signed.problems if "untrusted" not in problem]
    return f"its credentials do not hold: {'; '.join(problems or signed.problems)}", False


def _context() -> Any:
    import c2pa

    return c2pa.Context.from_dict(OFFLINE)


def _smallest_image() -> bytes:
    """A PNG of one pixel: the smallest file that can be signed."""
    with io.BytesIO() as stream:
        Image.new("L", (1, 1)).save(stream, "PNG")
        return stream.getvalue()
