"""Two-port theory of a wave energy converter (MASK4 report (Sandia), chapters 2 and 5).

The functions are pure.

Phasors are those of exp(+j omega t). Impedances are in N s/m on the linear side and in ohm on the
electrical side. The two-port current is F / (sqrt(3/2) Kt N), not the drive current
(docs/explanation/signs.md). Absorbed power is negative, as in the whole project.
"""
