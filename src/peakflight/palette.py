"""The colours that pictures and pages share, on white paper."""

INK = "#1f1f1f"
SOFT = "#767676"
"""Marks that should not compete with the data."""
FAINT = "#d4d4d4"
LIMIT = "#b3261e"
"""Limits: red in colour, dashed in grey."""

SPEEDS = (
    "#bddf26",
    "#7ad151",
    "#44bf70",
    "#22a884",
    "#21918c",
    "#2a788e",
    "#355f8d",
    "#414487",
    "#482475",
    "#440154",
)
"""From slow to fast on white paper: viridis without its palest end, even in lightness, so that it
reads the same in grey and to those who see colours differently."""
