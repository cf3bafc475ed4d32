"""How pages look: type, spacing, colours and components, and the parts of others that draw."""

from pathlib import Path

FOLDER = Path(__file__).parent
STYLE, CURVE_STYLE, CURVES = "design.css", "vendor/uplot.css", "vendor/uplot.js"
