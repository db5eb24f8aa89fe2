"""Two-port theory of a wave energy converter (MASK4 report (Sandia), chapters 2 and 5). Pure.

Phasors are those of exp(+j omega t), impedances of the linear side in N s/m, of the electrical side
in ohm. The two-port current is F / (sqrt(3/2) Kt N), not the drive current (docs/signs.md). Power
here is that of the house: absorbed is negative.
"""
