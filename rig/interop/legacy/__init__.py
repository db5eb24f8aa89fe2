"""Files of earlier campaigns: gain matrices of other rigs, and the log of a test.

What is read is reported as it was found; what cannot be known from the file is asked for, never
guessed.
"""
