"""Checks of consent: its days, its languages, its films."""

import datetime
from collections.abc import Iterator
from pathlib import Path

from dubbing.engine.disk.file_digests import sha256_of
from dubbing.engine.disk.numbered import plain
from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.yaml_lines import KeyPath


def of_identity(identity: Identity, today: datetime.date) -> Iterator[tuple[KeyPath, str]]:
    """Problems of the consent of a person itself, with the keys in their entry."""
    consent = identity.consent
    if consent.date is not None and consent.date > today:
        yield ("consent", "date"), f"{consent.date} is still to come: it was given on no such day"
    if consent.until is not None and consent.until < today:
        message = f"the consent of {consent.by} ended on {consent.until}: ask for it again"
        yield ("consent", "until"), message
    if consent.file is None:
        if consent.sha256 is not None:
            yield ("consent", "sha256"), "belongs to a file: name it, `file: FILE`"
    elif not consent.file.is_file():
        yield ("consent", "file"), f"no such file: {consent.file}"
    elif consent.sha256 not in (None, found := sha256_of(consent.file)):
        message = f"{consent.file} is not what was agreed to: its SHA-256 is {found}"
        yield ("consent", "sha256"), message
    if consent.films is not None and not all(
        covers_film(consent.films, clip) for clip in identity.learned_clips
    ):
        yield ("clip",), f"the consent of {consent.by} does not name this film"


def of_dub(dub: Dub, identity: Identity) -> Iterator[tuple[KeyPath, str]]:
    """Why a dub is outside of what a person agreed to, with the keys in its entry."""
    consent, film = identity.consent, dub.clip or identity.clip
    if consent.films is not None and not covers_film(consent.films, film):
        key = "clip" if dub.clip else "identity" if dub.identity else "speakers"
        yield (key,), f"the consent of {consent.by} does not name its film, {plain(film).name}"
    if consent.languages is None:
        return
    named = ", ".join(consent.languages)
    if dub.language is None:
        yield ("language",), f"is required: the consent of {consent.by} is for {named} alone"
    elif not any(covers(agreed, dub.language) for agreed in consent.languages):
        yield ("language",), f"the consent of {consent.by} is for {named}, not for {dub.language}"


def covers(agreed: str, language: str) -> bool:
    """Whether a language is one that was agreed to: ``it`` covers ``it-CH``, not the reverse."""
    own, other = agreed.casefold(), language.casefold()
    return other == own or other.startswith(f"{own}-")


def covers_film(films: tuple[Path | str, ...], clip: Path) -> bool:
    """Whether a clip is one of these files, or has one of these SHA-256."""
    if any(isinstance(film, Path) and _same(film, clip) for film in films):
        return True
    digests = {film.casefold() for film in films if isinstance(film, str)}
    clip = plain(clip)
    return bool(digests) and clip.is_file() and sha256_of(clip) in digests


def _same(one: Path, other: Path) -> bool:
    one, other = plain(one), plain(other)
    return one == other or (one.exists() and other.exists() and one.samefile(other))
