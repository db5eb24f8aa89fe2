"""Analysis of sessions of the bench: the results of a dynamometer run in the form of the OSWEC
thesis.
"""

from rig.kinds.oswec_bench.products.analyse import KINDS, Summary, analyse

__all__ = ["KINDS", "Summary", "analyse"]
