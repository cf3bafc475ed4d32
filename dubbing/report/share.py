"""The page of a report in one file with all that it shows, which opens anywhere."""

import zipfile
from pathlib import Path
from typing import Any

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import atomic_path
from dubbing.errors import ExplainedError
from dubbing.production.production import REPORTS, Production
from dubbing.report.page import page_of
from dubbing.report.sources import PROXIES, proxy_of

PAGE, DATA = REPORTS
FOLDER = "videos"  # in the archive


def pack(production: Production, out: Path) -> list[str]:
    """Write the last report with its videos into a ZIP archive; gives the dubs without a video.

    Films are packed as small copies, and so are dubs that have one.

    Raises:
        ExplainedError: there is no report, or the archive cannot be written.
    """
    remedy = f"run first: dfrf dub {production.manifest}"
    if not (production.output / DATA).is_file():
        raise ExplainedError("there is no report yet", str(production.output), remedy)
    found: dict[str, Any] = json_records.read(production.output / DATA, dict[str, Any], "report")
    files: dict[str, Path] = {}

    def packed(name: str, path: Path | None) -> str | None:
        if path is None or not path.is_file():
            return None
        files[f"{FOLDER}/{name}{path.suffix}"] = path
        return f"{FOLDER}/{name}{path.suffix}"

    for name, dub in found["dubs"].items():
        video, source, thumbnail = (
            production.output / dub[key] if dub.get(key) else None
            for key in ("video", "source", "thumbnail")
        )
        if source is not None and source.is_file() and source.parent.name != PROXIES:
            source = proxy_of(source, production.work)
        dub["video"] = packed(name, video)
        dub["source"] = packed(f"source_{source.stem}", source) if source else None
        dub["thumbnail"] = packed(f"{name}_thumbnail", thumbnail)
    for person in found["identities"].values():
        person["contact_sheet"] = None
    with atomic_path(out) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        archive.writestr(PAGE, page_of(found))
        for name, path in sorted(files.items()):
            archive.write(path, name)
    return [name for name, dub in found["dubs"].items() if dub["video"] is None]
