"""Exit codes of the commands."""

OK = 0
FAILED = 1
BAD_INPUT = 2
STOPPED = 3  # by the operator
FAULT = 4  # the rig tripped
LOST = 5  # a process died, or rows were lost
