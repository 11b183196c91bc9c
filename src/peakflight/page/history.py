"""Undo and redo: what was, what is, and what was taken back."""

from dataclasses import dataclass, replace
from typing import Self

from peakflight.page.edited import Edited

LONGEST = 500
"""Steps that can be undone."""


@dataclass(frozen=True, eq=False)
class History:
    """A row of states, of which one is the present."""

    present: Edited
    past: tuple[Edited, ...] = ()
    """Oldest first."""
    future: tuple[Edited, ...] = ()
    """What was undone, the last first."""
    gesture: str = ""
    """What the present is a part of: one drag of a handle or a slider is one step."""

    def do(self, edited: Edited, gesture: str = "") -> Self:
        """Go on to a state; within one gesture, in place of the present."""
        if gesture and gesture == self.gesture:
            return replace(self, present=edited, future=())
        past = (*self.past, self.present)[-LONGEST:]
        return replace(self, present=edited, past=past, future=(), gesture=gesture)

    def rest(self) -> Self:
        """End the gesture."""
        return replace(self, gesture="")

    def undo(self) -> Self:
        """Go back by a step, if there is one."""
        if not self.past:
            return self.rest()
        *past, present = self.past
        future = (self.present, *self.future)
        return replace(self, present=present, past=tuple(past), future=future, gesture="")

    def redo(self) -> Self:
        """Take an undo back, if there was one."""
        if not self.future:
            return self.rest()
        present, *future = self.future
        past = (*self.past, self.present)
        return replace(self, present=present, past=past, future=tuple(future), gesture="")
