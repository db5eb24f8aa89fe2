"""Results of a modular rig's runs: rows, power surfaces and summary, as of every campaign."""

from rig.analysis.report import NO_PRODUCTS, PROGRESS, after_run, draw, summarise

__all__ = ["NO_PRODUCTS", "PROGRESS", "after_run", "draw", "summarise"]
