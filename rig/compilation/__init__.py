"""Compilation of undecorated tick functions by numba, and their flat memory."""
