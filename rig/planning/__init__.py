"""Parts of every plan: points, order, windows, segments, references, and the input files.

A kind of rig composes its campaigns or sessions of them. The supervisor alone runs this package;
the loop receives the finished table of segments.
"""
