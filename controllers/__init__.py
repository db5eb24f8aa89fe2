"""Control laws and estimators: pure functions over NamedTuples of floats.

Every law has the shape ``step(params, state, inputs, dt) -> (state, output)``: no clock, no I/O,
no hidden state. Signs: a force is the force on the body, F = Kp v + Ki x, so Kp < 0 absorbs and
Ki > 0 acts as a negative spring; absorbed power is negative.
"""
