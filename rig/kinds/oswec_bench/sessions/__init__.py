"""Sessions of the bench: from the session file to the table that the loop runs.

This package runs in the supervisor only; the loop receives the finished plan.
"""
