"""Control laws and estimators: pure functions over NamedTuples of floats.

Every law has the shape ``step(params, state, inputs, dt) -> (state, output)``: no clock, no I/O,
no hidden state. Signs: a force is the force on the body, F = Kp v + Ki x + Km a, so Kp < 0 absorbs,
Ki > 0 acts as a negative spring and Km > 0 as a negative mass; absorbed power is negative.
"""
