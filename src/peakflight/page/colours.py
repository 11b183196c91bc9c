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


def for_lines(shown: np.ndarray) -> np.ndarray:
    """What to give lines, (..., 3) of 0 to 255, so that they look like this.

    viser takes the colours of lines for linear light and draws that through a film curve (the fit
    of ACES by S. Hill that three.js has), which pales them; this undoes both, as far as it goes.
    """
    share = np.asarray(shown, dtype=float) / 255.0
    light = np.where(share < 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    curve = np.clip(light @ np.linalg.inv(FILM_OUT).T, 0.0, FILM_TOP)
    a = 1.0 - FILM_C * curve
    b = FILM_A - FILM_D * curve
    c = -(FILM_B + FILM_E * curve)
    before = (-b + np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    given = FILM_EXPOSURE * before @ np.linalg.inv(FILM_IN).T
    return np.rint(255.0 * np.clip(given, 0.0, 1.0)).astype(np.uint8)


FILM_IN = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
FILM_OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
FILM_A, FILM_B, FILM_C, FILM_D, FILM_E = 0.0245786, 0.000090537, 0.983729, 0.4329510, 0.238081
FILM_EXPOSURE, FILM_TOP = 0.6, 0.95
"""Of the film curve; no light comes out brighter than its top."""
