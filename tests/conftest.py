"""What holds for all tests."""

from __future__ import annotations

import signal

from hypothesis import settings

# A shared host stands still for longer than any example takes; what must be quick is measured in
# benchmarks/.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

# What is started in the background of a shell, or by nohup, ignores these, and so do its children:
# a test that sends Ctrl-C would then wait for ever.
for _number, _usual in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGQUIT, signal.SIG_DFL),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(_number) == signal.SIG_IGN:
        signal.signal(_number, _usual)
