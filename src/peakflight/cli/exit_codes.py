"""With what the command line ends; 0 and 1 are for commands to say what they mean."""

BAD_INPUT = 2
INTERRUPTED = 130
"""After Ctrl-C: 128 and the number of the signal."""
