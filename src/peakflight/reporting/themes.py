"""The two dresses of a report, for light and for dark surroundings."""

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from peakflight.palette import FAINT, INK, LIMIT, SPEEDS

FAST_ON_DARK = (
    "#414487",
    "#355f8d",
    "#2a788e",
    "#21918c",
    "#22a884",
    "#44bf70",
    "#7ad151",
    "#bddf26",
    "#fde725",
)
"""From slow to fast on a dark page: viridis without its darkest end."""
ROTORS_ON_PAPER = ("#440154", "#31688e", "#1f9e89", "#8a9a00")
ROTORS_ON_DARK = ("#b39ddb", "#6fb3e0", "#35d0b0", "#e6d94a")
KINDS_ON_PAPER = SPEEDS[::-1]
"""Bars of a kind of limit; patterns tell them apart as well."""
ORDER = (0, 5, 2, 8, 7, 4, 1, 6)
"""Of those colours, so that neighbours differ in lightness."""


def _scale(colours: tuple[str, ...]) -> list[list[Any]]:
    last = len(colours) - 1
    return [[index / last, colour] for index, colour in enumerate(colours)]


def _numbered(name: str, colours: tuple[str, ...]) -> dict[str, str]:
    return {f"{name}-{index}": colour for index, colour in enumerate(colours)}


THEMES: Mapping[str, Mapping[str, Any]] = {
    "light": {
        "ink": INK,
        "soft": "#5f5f5f",
        "faint": FAINT,
        "grid": "#ececec",
        "paper": "#ffffff",
        "card": "#f6f6f4",
        "limit": LIMIT,
        "good": "#1b6e3c",
        "good-paper": "#e9f4ed",
        "bad-paper": "#fbeceb",
        "link": "#2a5d8f",
        "followed": "#5b8fc2",
        "speeds": _scale(SPEEDS),
        **_numbered("rotor", ROTORS_ON_PAPER),
        **_numbered("kind", tuple(KINDS_ON_PAPER[index] for index in ORDER)),
    },
    "dark": {
        "ink": "#e9e9e6",
        "soft": "#a6a6a2",
        "faint": "#47494d",
        "grid": "#2b2d31",
        "paper": "#17181b",
        "card": "#202226",
        "limit": "#ff8f80",
        "good": "#7fd6a0",
        "good-paper": "#17301f",
        "bad-paper": "#3a1b18",
        "link": "#8fbfee",
        "followed": "#6fa8dc",
        "speeds": _scale(FAST_ON_DARK),
        **_numbered("rotor", ROTORS_ON_DARK),
        **_numbered("kind", tuple(FAST_ON_DARK[min(index, 8)] for index in ORDER)),
    },
}
"""Name of a colour to what it is; `speeds` is a scale as Plotly takes it."""


def style_sheet() -> str:
    """The style of the page, in both dresses."""
    light, dark = (_variables(THEMES[name]) for name in ("light", "dark"))
    own = files("peakflight.reporting").joinpath("page.css").read_text(encoding="utf-8")
    return (
        f":root {{ color-scheme: light dark; {light} }}\n"
        f"@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"
        f"@media print {{ :root {{ {light} }} }}\n{own}"
    )


def _variables(theme: Mapping[str, Any]) -> str:
    return " ".join(f"--{name}: {colour};" for name, colour in theme.items() if name != "speeds")
