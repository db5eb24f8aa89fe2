"""What holds for all tests."""

from __future__ import annotations

from hypothesis import settings

# A shared host stands still for longer than any example takes; what must be quick is measured in
# benchmarks/.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")
