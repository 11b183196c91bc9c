"""The colours that pictures and pages share, on white paper."""

INK = "#1f1f1f"
SOFT = "#767676"
"""Marks that should not compete with the data."""
FAINT = "#d4d4d4"
LIMIT = "#b3261e"
"""Limits: red in colour, dashed in grey."""
