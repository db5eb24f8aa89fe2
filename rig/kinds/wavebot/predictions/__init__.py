"""Prediction of a campaign before it runs: motion, power, margins and stability of every row.

The prediction works in the frequency domain, in the campaign's sea, with the parameters of the
simulated plant; `rig.design.steady_motion` describes the method. It covers the steady state that
repeats with the sea. Transients (waves building up, gain changes, stator moves) come on top.
"""
