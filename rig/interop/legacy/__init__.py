"""Files of earlier campaigns: gain matrices of other rigs, and the log of a test.

The readers report a file's contents unchanged. Information that a file does not contain is required
as an option and never guessed.
"""
