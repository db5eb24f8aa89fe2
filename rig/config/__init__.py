"""Configuration files: reading, validation and frozen models.

All problems of all files are reported at once, each with file, line, key and allowed range.
"""
