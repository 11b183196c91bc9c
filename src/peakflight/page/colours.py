"""The colours of the page: one scale for speed, and one meaning for each of the others."""

import numpy as np

SCALE = np.array(
    [
        [68, 1, 84],
        [71, 44, 122],
        [59, 81, 139],
        [44, 113, 142],
        [33, 144, 141],
        [39, 173, 129],
        [92, 200, 99],
        [170, 220, 50],
        [253, 231, 37],
    ]
)
"""Viridis (Smith and van der Walt, CC0) at even steps: slow is dark, fast is bright."""

INK = "#1f2933"
"""Text."""
QUIET = "#69788a"
"""Text that explains."""
GOOD = "#12805c"
"""Proven."""
BAD = "#c22f2f"
"""Not proven, refused; and limits."""
BUSY = "#8a6100"
"""At work."""
CURVE = "#2b6cb0"
"""What is planned, in plots."""
OTHERS = ("#2b6cb0", "#dd7a1b", "#2f9e6e", "#8e5cc0")
"""The four rotors."""
WAYPOINT, CHOSEN, END = (43, 108, 176), (255, 122, 26), (31, 41, 51)
"""Handles: any, the chosen one, and first and last."""
GHOST = (150, 160, 172)
"""What was accepted, to compare with."""
REFUSED = (194, 47, 47)
"""A path that is not proven."""
RING = (120, 140, 165)
THRUST = (221, 90, 30)


def along_scale(shares: np.ndarray) -> np.ndarray:
    """(..., 3) colours, 0 to 255, of shares from 0 to 1."""
    places = np.clip(shares, 0.0, 1.0) * (len(SCALE) - 1)
    steps = np.arange(len(SCALE))
    channels = [np.interp(places, steps, SCALE[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=-1).astype(np.uint8)


def gradient() -> str:
    """The scale as CSS, from left to right."""
    stops = ", ".join(f"rgb({red},{green},{blue})" for red, green, blue in SCALE)
    return f"linear-gradient(90deg, {stops})"
