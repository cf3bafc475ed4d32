"""The JSON Schema of a manifest, built from the models of its entries: editors complete keys by it.

It takes every manifest that `dubbing.manifest.manifest.load` takes. What needs a look at other
entries or at files is left to `dfrf plan`.
"""

import json
from importlib import resources
from pathlib import Path
from typing import Any

from dubbing.manifest.keys.dub_entry import Dub
from dubbing.manifest.keys.identity_entry import Identity
from dubbing.manifest.keys.values import LONGEST_NAME, NAME_PATTERN
from dubbing.manifest.reader import TOP

FILE = "manifest.schema.json"  # beside this module, as `dfrf schema` prints it
DIALECT = "http://json-schema.org/draft-07/schema#"  # of those that editors know, the newest
DEFINITIONS = "#/$defs/"
VERSION = "Version of the format: 1."
OUTPUT = "Folder for the results, and for the work in progress in `work`."
TIMELINE = "The cut of the dubs (EDL, FCPXML, AAF, OTIO); it comes out with them above."
DEFAULTS = "Any key of an identity or of a dub, for all entries that do not set it themselves."
IDENTITIES = "The people, by a name of yours."
DUBS = "The results to make."


def build() -> dict[str, Any]:
    """The schema as plain data, in draft 7."""
    parts: dict[str, Any] = {}
    for model in (Identity, Dub):
        part = model.model_json_schema(ref_template=DEFINITIONS + "{model}")
        parts |= {**part.pop("$defs", {}), model.__name__: part}
    parts = {name: _tidied(part) for name, part in sorted(parts.items())}
    # Where `defaults` has one of these keys, an entry may do without.
    required = {name: parts[name].pop("required") for name in ("Identity", "Dub", "Consent")}
    required["Identity"].remove("clip")
    keys = {"clip", "clips", *required["Identity"], *required["Dub"]} - {"name"}
    person = {
        "required": required["Identity"],
        "anyOf": [{"required": ["clip"]}, {"required": ["clips"]}],
        "properties": {"consent": {"required": required["Consent"]}},
    }
    dub = {"required": [key for key in required["Dub"] if key != "name"]}
    both = {**parts["Dub"]["properties"], **parts["Identity"]["properties"]}
    name = {"pattern": NAME_PATTERN, "maxLength": LONGEST_NAME}
    top = {
        "version": {"const": 1, "description": VERSION},
        "output": {"type": "string", "format": "path", "pattern": r"\S", "description": OUTPUT},
        "timeline": {
            "type": ["string", "null"],
            "format": "path",
            "pattern": r"\S",
            "description": TIMELINE,
        },
        "defaults": {
            "type": ["object", "null"],
            "properties": dict(sorted(both.items())),
            "additionalProperties": False,
            "description": DEFAULTS,
        },
        "identities": {
            "type": "object",
            "propertyNames": name,
            "additionalProperties": {"$ref": DEFINITIONS + "Identity"},
            "minProperties": 1,
            "description": IDENTITIES,
        },
        "dubs": {
            "type": ["array", "null"],
            "items": {"$ref": DEFINITIONS + "Dub"},
            "description": DUBS,
        },
    }
    assert tuple(top) == TOP
    return {
        "$schema": DIALECT,
        "title": "Manifest of dfrf",
        "type": "object",
        "properties": top,
        "additionalProperties": False,
        "required": ["version", "output", "identities"],
        "if": {"properties": {"defaults": {"properties": dict.fromkeys(sorted(keys), False)}}},
        "then": {
            "properties": {"identities": {"additionalProperties": person}, "dubs": {"items": dub}}
        },
        "$defs": parts,
    }


def text() -> str:
    """The schema as `dfrf schema` prints it."""
    return json.dumps(build(), indent=2, ensure_ascii=False) + "\n"


def shipped_uri() -> str:
    """Where the shipped schema lies on this machine, for the line that editors look for."""
    return Path(str(resources.files(__package__) / FILE)).resolve().as_uri()


def _tidied(node: Any) -> Any:
    """Without titles, which repeat the keys, and what draft 7 does not know."""
    if isinstance(node, list):
        return [_tidied(one) for one in node]
    if not isinstance(node, dict):
        return node
    found = {
        key: " ".join(value.split()) if key == "description" else _tidied(value)
        for key, value in node.items()
        if not (key in ("title", "gt", "le") and not isinstance(value, dict))
    }
    if len(found) > 1 and (target := found.pop("$ref", None)):
        found["allOf"] = [{"$ref": target}]  # draft 7 sees nothing beside a `$ref`
    return found
