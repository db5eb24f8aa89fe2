"""The statusword against golden words and against an independent decoder."""

from __future__ import annotations

import pytest
from canopen.profiles import p402

from drivers.cia402 import statusword
from drivers.cia402.statusword import DriveState, decode, describe

# Statuswords as drives send them: voltage, remote, target and manufacturer bits set, too.
GOLDEN = {
    0x0000: "NOT_READY_TO_SWITCH_ON",
    0x0250: "SWITCH_ON_DISABLED",
    0x0640: "SWITCH_ON_DISABLED",
    0x0231: "READY_TO_SWITCH_ON",
    0x0233: "SWITCHED_ON",
    0x0237: "OPERATION_ENABLED",
    0x1637: "OPERATION_ENABLED",
    0x0217: "QUICK_STOP_ACTIVE",
    0x021F: "FAULT_REACTION_ACTIVE",
    0x023F: "FAULT_REACTION_ACTIVE",
    0x0218: "FAULT",
    0x0628: "FAULT",  # an AMC drive in fault: bit 5 does not count
    0x0201: "UNKNOWN",  # ready, but quick stop not released
    0x0277: "UNKNOWN",  # enabled and disabled at once
    0x022B: "UNKNOWN",
    0xFFFF: "UNKNOWN",
}

PEER = {
    "NOT READY TO SWITCH ON": "NOT_READY_TO_SWITCH_ON",
    "SWITCH ON DISABLED": "SWITCH_ON_DISABLED",
    "READY TO SWITCH ON": "READY_TO_SWITCH_ON",
    "SWITCHED ON": "SWITCHED_ON",
    "OPERATION ENABLED": "OPERATION_ENABLED",
    "FAULT": "FAULT",
    "FAULT REACTION ACTIVE": "FAULT_REACTION_ACTIVE",
    "QUICK STOP ACTIVE": "QUICK_STOP_ACTIVE",
}


@pytest.mark.parametrize(("word", "name"), GOLDEN.items(), ids=lambda v: f"{v}")
def test_golden_words(word: int, name: str) -> None:
    assert DriveState(decode(word)).name == name


def test_every_word_is_in_one_state_at_most() -> None:
    for word in range(0x10000):
        states = [state for mask, value, state in statusword.CODING if word & mask == value]
        assert len(states) <= 1
        assert decode(word) == (states[0] if states else DriveState.UNKNOWN)


def test_an_independent_decoder_reads_every_word_alike() -> None:
    def peer(word: int) -> str:
        for name, (mask, value) in p402.State402.SW_MASK.items():
            if word & mask == value:
                return PEER[name]
        return "UNKNOWN"

    assert set(PEER) == set(p402.State402.SW_MASK)
    differ = {
        f"{word:#06x}": (peer(word), DriveState(decode(word)).name)
        for word in range(0x10000)
        if peer(word) != DriveState(decode(word)).name
    }
    assert differ == {}


def test_states_have_plain_twins_in_their_order() -> None:
    assert [int(state) for state in DriveState] == [
        statusword.UNKNOWN, statusword.NOT_READY, statusword.DISABLED, statusword.READY,
        statusword.SWITCHED_ON, statusword.ENABLED, statusword.QUICK_STOPPING,
        statusword.FAULT_REACTION, statusword.FAULT,
    ]  # fmt: skip


def test_statusword_texts() -> None:
    assert describe(0x1637) == (
        "0x1637 operation enabled, voltage enabled, remote, target reached, mode bit 12"
    )
