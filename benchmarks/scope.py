"""How much a run measures."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Scope:
    """What the command line asks for."""

    quick: bool = False
    """A smoke test for CI: fewer courses, sizes and repetitions."""
    full: bool = False
    """Everything, `peak` at 100,000 legs included."""

    def pick(self, quick: int, default: int) -> int:
        """One of two counts, by the size of the run."""
        return quick if self.quick else default

    @property
    def name(self) -> str:
        """What the run is called."""
        return "quick" if self.quick else "full" if self.full else "default"
