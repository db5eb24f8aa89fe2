"""Benchmarks: one file a measurement, each with a function ``measure(short)``.

``python -m benchmarks`` runs all of them, prints a table and keeps the figures in ``results/``.
"""
