"""Sessions of the bench: what a dynamometer run gives, in the form of the OSWEC thesis."""

from rig.analysis.session.analyse import KINDS, Summary, analyse

__all__ = ["KINDS", "Summary", "analyse"]
