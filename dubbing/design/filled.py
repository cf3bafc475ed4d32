"""A page in one file, which needs no network and no server."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup


def filled(template: Path, data: Any, parts: Mapping[str, str], **texts: str) -> str:
    """The HTML of a template.

    Args:
        data: for its script, as JSON; becomes `data`.
        parts: styles and scripts, which stand in it as they are.
        texts: which are escaped.
    """
    written = json.dumps(data, ensure_ascii=False).replace("<", "\\u003c")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    page = environment.from_string(template.read_text(encoding="utf-8"))
    return page.render({k: Markup(v) for k, v in {"data": written, **parts}.items()}, **texts)
