"""Base of the entries of a manifest."""

from pydantic import BaseModel, ConfigDict


class Entry(BaseModel):
    """Frozen, of exact types and finite numbers, without unknown keys.

    The text below a field is its description, in the schema and in the reference.
    """

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )
