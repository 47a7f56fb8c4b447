"""Colours, style sheet and script of every page; the palette is that of all pictures."""

from __future__ import annotations

from importlib import resources

from ilc_rt.pictures.themes import THEMES, Theme

#: What the pictures do not need: the ground behind panels, states, a chosen row.
PAGE = {
    "light": {"page": "#F4F5F7", "good": "#00754F", "warn": "#9A5B00", "bad": "#B3261E",
              "chosen": "#E6F1F9"},
    "dark": {"page": "#0D0F13", "good": "#2FC79A", "warn": "#E6B23C", "bad": "#FF7B72",
             "chosen": "#1B2C3A"},
}  # fmt: skip

#: Calls that come before the script has loaded wait in a queue.
STUB = """
<script>
document.documentElement.lang = "en";
window.ilc = {queue: []};
for (const name of ["draw", "live", "theme"])
  window.ilc[name] = (...values) => window.ilc.queue.push([name, ...values]);
window.ilc.shown = () => new Promise((done) => addEventListener("load", () => done()));
</script>
<script type="module" src="/dashboard/dashboard.js"></script>
<link rel="stylesheet" href="/dashboard/colours.css">
<link rel="stylesheet" href="/dashboard/dashboard.css">
"""


def colours() -> str:
    """Return the style sheet with the colours of both themes."""
    return (
        f"body {{ color-scheme: light; {_variables('light')} }}\n"
        f"body.body--dark {{ color-scheme: dark; {_variables('dark')} }}\n"
    )


def text_of(name: str) -> str:
    """Return the style sheet or the script."""
    return resources.files("ilc_rt").joinpath(f"data/{name}").read_text(encoding="utf-8")


def _variables(name: str) -> str:
    theme: Theme = THEMES[name]
    roles = {
        "ground": theme.ground, "ink": theme.ink, "ticks": theme.ticks, "edge": theme.edge,
        "grid": theme.grid, **PAGE[name],
    }  # fmt: skip
    roles |= {f"series{number}": colour for number, colour in enumerate(theme.series)}
    return " ".join(f"--{role}: {colour};" for role, colour in roles.items())
