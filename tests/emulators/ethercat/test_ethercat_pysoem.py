"""The emulated segment before an independent master: pysoem, unchanged."""

from __future__ import annotations

import pytest
from master_process import scenario
from pysoem_lines import ALL_OP, COUNTER, IDENTITY, VENDOR

pytest.importorskip("pysoem", reason="pysoem is not installed (extra `ethercat`)")
pytestmark = pytest.mark.realtime

SAFEOP_ERROR, OP = 0x14, 0x08


def test_start_sdo_and_process_data() -> None:
    seen = scenario("start")
    assert [tuple(each) for each in seen["identity"]] == IDENTITY
    assert seen["sizes"] == [
        [0, 0], [6, 10], [3, 3], [0, 1], [0, 1], [1, 0], [1, 0], [0, 8], [0, 20],
    ]  # fmt: skip
    assert set(seen["counters"]) == {COUNTER}
    assert seen["expedited"] == VENDOR
    assert seen["normal"] == "Torque drive"
    assert seen["digital"] == ["05", "00"]  # the second input is wired to the second output
    assert seen["written"] == 5000
    assert seen["aborts"] == {
        "8000:1 4": 0x06090032, "8000:7 1": 0x06090011, "1234:0 1": 0x06020000,
        "1018:1 4": 0x06010002, "1C12:0 1": 0x08000022, "8000:1 1": 0x06070013,
    }  # fmt: skip
    assert seen["objects"]["6041"] == "Statusword"
    assert seen["objects"]["1C12"] == "RxPDO assignment"
    assert seen["statusword"] == [6, 16, 0x87]
    states = {slave["state"] for slave in seen["report"]["slaves"].values()}
    assert states == {"OP"}
    assert seen["malformed"] == 0


def test_remap_segments_and_torque() -> None:
    seen = scenario("remap")
    assert seen["read_back"] == "0300" + "10004060" + "10007160" + "08006060"
    assert seen["sizes"] == [5, 9, 4 + 10 * 4]
    assert seen["samples"] == [20, 2 + 20 * 4]
    assert seen["statuswords"] == [0x60, 0x21, 0x23, 0x27]
    assert seen["mode"] == 10
    assert seen["current"] == pytest.approx(5.0, abs=0.02)
    assert seen["turned"] > 0
    assert seen["emergencies"] == [[0x2310, 0x03]]
    assert seen["fault"] == 0x08


def check_cyclic(seconds: float) -> None:
    seen = scenario("cyclic", seconds)
    assert set(seen["counters"]) == {str(COUNTER)}, seen
    assert seen["counters"][str(COUNTER)] == pytest.approx(1000.0 * seconds, rel=0.01)
    assert seen["states"] == ALL_OP
    assert (seen["malformed"], seen["lost"]) == (0, 0)
    print(seen)


def test_3_s_at_1_khz() -> None:
    check_cyclic(3.0)


@pytest.mark.long(soak=True)
def test_10_min_at_1_khz() -> None:
    check_cyclic(600.0)


def test_unplugging_recovery_and_faults_of_the_line() -> None:
    seen = scenario("faults")
    assert seen["unplugged"] == 3  # coupler and torque drive are left
    assert seen["replugged"] == COUNTER - 3
    assert seen["lost"] == [2]
    assert seen["recovered"] == [COUNTER] * 5
    assert sorted(seen["short"]) == [COUNTER - 3] * 2 + [COUNTER] * 4
    assert seen["al_error"] == [SAFEOP_ERROR, 0x2D]
    assert seen["no_frame"] == -1
    assert seen["duplicates"] == COUNTER


def test_watchdog_emergency_and_mute_mailbox() -> None:
    """Slaves with outputs fall to SAFEOP with 0x1B, the others stay in OP."""
    seen = scenario("silence")
    fallen = [SAFEOP_ERROR, 0x1B]
    assert seen["watchdog"] == [
        [OP, 0], fallen, fallen, [OP, 0], [OP, 0], fallen, fallen, [OP, 0], [OP, 0],
    ]  # fmt: skip
    assert seen["again"] == COUNTER
    assert seen["emergencies"] == [[0x8250, 0x11], [0xFF07, 0x91]]
    assert seen["mailbox"] == "WkcError"


def test_sync0_and_overlapping_process_data() -> None:
    """The drive follows SYNC0; the master reads system time; missed pulses depend on the host."""
    seen = scenario("synchronous")
    assert seen["dc"]
    assert seen["statuswords"] == [0x60, 0x21, 0x23, 0x27]
    assert seen["counters"] == [COUNTER]
    assert seen["dc_rate"] == pytest.approx(1.0, abs=0.02)  # a frame is 1 ms of 500 ms
    assert seen["missed"] < 1000
    assert seen["states"] == ALL_OP


def test_wrong_devices_at_start() -> None:
    seen = scenario("wrong_line")
    products = [each[2] for each in seen["identity"]]
    expected = [each[2] for each in IDENTITY]
    expected[1] = 0x99
    expected[3:5] = expected[4], expected[3]
    assert products == expected
    assert (seen["cut"], seen["whole"]) == (6, 9)
    assert seen["damaged"] == 0xFFFFFFFF
    assert seen["states"] == [2] * 8 + [0x11]
