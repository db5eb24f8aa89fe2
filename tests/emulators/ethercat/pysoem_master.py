"""An independent master (pysoem, which contains SOEM) on one end of a veth pair; the emulated
segment is a process of its own on the other end.

`unshare -Urn python pysoem_master.py SCENARIO [SECONDS]` prints one line of JSON: what the master
saw. It needs no privileges in a user namespace of its own, root otherwise.
"""

from __future__ import annotations

import json
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pysoem
from pysoem_lines import COUNTER

MASTER_END, SEGMENT_END = "ecmaster", "ecslaves"
LINE = (
    "coupler", "torque_drive", "position_drive", "digital_in:4", "digital_in:8", "digital_out:4",
    "digital_out:2", "analog_in", "encoder:2",
)  # fmt: skip
TORQUE, POSITION, DIGITAL_IN, DIGITAL_OUT, ANALOG, ENCODER = 1, 2, 3, 5, 7, 8


ANSWER_US = 2_000_000  # timeout of a frame: longer than any stall of a shared host


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)


class Bench:
    """The master and the console of the emulator."""

    def __init__(self, emulator: subprocess.Popen[str]) -> None:
        self.emulator = emulator
        self.master = pysoem.Master()
        self.master.open(MASTER_END)

    def command(self, command: str) -> dict[str, Any]:
        assert self.emulator.stdin is not None
        assert self.emulator.stdout is not None
        self.emulator.stdin.write(command + "\n")
        self.emulator.stdin.flush()
        answer: dict[str, Any] = json.loads(self.emulator.stdout.readline())
        assert "error" not in answer, answer
        return answer

    def exchange(self) -> int:
        self.master.send_processdata()
        return int(self.master.receive_processdata(ANSWER_US))

    def exchanges(self, count: int, period: float = 0.001) -> list[int]:
        """Exchange process data at a rate; return the working counters."""
        counters = []
        due = time.perf_counter()
        for _ in range(count):
            due += period
            counters.append(self.exchange())
            time.sleep(max(0.0, due - time.perf_counter()))
        return counters

    def until(self, condition: Any, seconds: float = 5.0) -> float:
        """Exchange process data until a condition holds; return the time it took."""
        begin = time.perf_counter()
        while not condition():
            assert time.perf_counter() - begin < seconds, "not in time"
            self.exchange()
        return time.perf_counter() - begin

    def be_patient(self) -> None:
        """Give slaves with outputs a long watchdog: the host may stall."""
        for number in (TORQUE, POSITION, DIGITAL_OUT, DIGITAL_OUT + 1):
            set_watchdog(self.master.slaves[number], 5000.0)

    def reach_op(self) -> float:
        """Bring all slaves from INIT to OP; return the time it took."""
        begin = time.perf_counter()
        master = self.master
        assert master.config_init() == len(LINE)
        master.config_dc()
        master.config_map()
        assert master.state_check(pysoem.SAFEOP_STATE, 1_000_000) == pysoem.SAFEOP_STATE
        self.request_op()
        return time.perf_counter() - begin

    def request_op(self) -> None:
        self.exchange()
        self.master.state = pysoem.OP_STATE
        self.master.write_state()
        self.until(lambda: self.master.state_check(pysoem.OP_STATE, 1000) == pysoem.OP_STATE)

    def states(self) -> list[int]:
        self.master.read_state()
        return [slave.state for slave in self.master.slaves]

    def slave_states(self) -> Iterator[tuple[int, Any]]:
        return zip(self.states(), self.master.slaves, strict=True)


@contextmanager
def bench(capture: str = "") -> Iterator[Bench]:
    run("ip", "link", "add", MASTER_END, "type", "veth", "peer", "name", SEGMENT_END)
    for end in (MASTER_END, SEGMENT_END):
        with open(f"/proc/sys/net/ipv6/conf/{end}/disable_ipv6", "w") as switch:
            switch.write("1")
        run("ip", "link", "set", end, "up")
    command = [sys.executable, "-m", "sim_plant.emulators.ethercat", SEGMENT_END]
    command += ["--slaves", ",".join(LINE), *(["--capture", capture] if capture else [])]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as emulator:
        try:
            assert emulator.stdout is not None
            assert json.loads(emulator.stdout.readline())["ready"] == SEGMENT_END
            master_side = Bench(emulator)
            yield master_side
            master_side.master.close()
        finally:
            emulator.terminate()
            emulator.wait(10.0)
            subprocess.run(["ip", "link", "del", MASTER_END], check=False)


def emergencies(slave: Any) -> list[list[int]]:
    """Return code and register of the emergencies that wait in the mailbox."""
    got: list[list[int]] = []
    slave.add_emergency_callback(lambda one: got.append([one.error_code, one.error_reg]))
    for _ in range(8):
        slave.mbx_receive()
    return got


def set_watchdog(slave: Any, ms: float) -> None:
    """Set the process-data watchdog; pysoem waits 2 ms for a frame, which a busy host may need."""
    for _ in range(50):
        with suppress(pysoem.WkcError):
            slave.set_watchdog("processdata", ms)
            return
    raise AssertionError("no answer to the watchdog's registers")


def identity(slave: Any) -> list[Any]:
    return [slave.name, slave.man, slave.id]


def start(_: float) -> dict[str, Any]:
    """Identity, SDOs of all kinds, SDO information, process data."""
    with bench() as b:
        to_op = b.reach_op()
        drive, analog = b.master.slaves[TORQUE], b.master.slaves[ANALOG]
        seen: dict[str, Any] = {"to_op_s": to_op, "identity": [*map(identity, b.master.slaves)]}
        seen["sizes"] = [[len(each.output), len(each.input)] for each in b.master.slaves]
        seen["counters"] = b.exchanges(50)
        seen["expedited"] = struct.unpack("<I", drive.sdo_read(0x1018, 1))[0]
        seen["normal"] = drive.sdo_read(0x1008, 0).decode()
        b.master.slaves[DIGITAL_OUT].output = b"\x05"
        b.exchanges(20)
        seen["report"] = b.command("report")  # before SDOs, during which no frames keep OP
        seen["digital"] = [b.master.slaves[each].input.hex() for each in (DIGITAL_IN, 4)]
        analog.sdo_write(0x8000, 1, struct.pack("<I", 5000))
        seen["written"] = struct.unpack("<I", analog.sdo_read(0x8000, 1))[0]
        aborts = {}
        for index, sub, data in (
            (0x8000, 1, struct.pack("<I", 1)), (0x8000, 7, b"\0"), (0x1234, 0, b"\0"),
            (0x1018, 1, bytes(4)), (0x1C12, 0, b"\0"), (0x8000, 1, b"\0"),
        ):  # fmt: skip
            try:
                analog.sdo_write(index, sub, data)
            except pysoem.SdoError as error:
                aborts[f"{index:04X}:{sub} {len(data)}"] = error.abort_code
        seen["aborts"] = aborts
        seen["objects"] = {f"{each.index:04X}": each.name.decode() for each in drive.od}
        statusword = next(each for each in drive.od if each.index == 0x6041)
        seen["statusword"] = [statusword.data_type, statusword.bit_length, statusword.obj_access]
        seen["malformed"] = b.command("report")["malformed"]
        return seen


def remap(_: float) -> dict[str, Any]:
    """PDO remap in config_func, segmented transfers in both directions, CiA 402 to torque."""
    with bench() as b:
        seen: dict[str, Any] = {}

        def configure(position: int) -> None:
            drive = b.master.slaves[TORQUE]
            drive.sdo_write(0x1C12, 0, b"\0")
            drive.sdo_write(0x1C13, 0, b"\0")
            rx = [0x60400010, 0x60710010, 0x60600008]
            entries = struct.pack("<H32I", len(rx), *rx, *[0] * 29)
            drive.sdo_write(0x1600, 0, entries, True)  # 130 octets: in segments
            for sub, value in enumerate((0x60410010, 0x60770010, 0x606C0020, 0x60610008), start=1):
                if sub == 1:
                    drive.sdo_write(0x1A00, 0, b"\0")
                drive.sdo_write(0x1A00, sub, struct.pack("<I", value))
            drive.sdo_write(0x1A00, 0, b"\x04")
            for index, pdo in ((0x1C12, 0x1600), (0x1C13, 0x1A00)):
                drive.sdo_write(index, 1, struct.pack("<H", pdo))
                drive.sdo_write(index, 0, b"\x01")
            seen["read_back"] = drive.sdo_read(0x1600, 0, 200, True).hex()

        assert b.master.config_init() == len(LINE)
        analog = b.master.slaves[ANALOG]
        b.master.slaves[TORQUE].config_func = configure
        analog.config_func = lambda _: analog.sdo_write(
            0x1C13, 0, struct.pack("<HHH", 2, 0x1A00, 0x1A15), True
        )
        b.master.config_map()
        assert b.master.state_check(pysoem.SAFEOP_STATE, 1_000_000) == pysoem.SAFEOP_STATE
        b.request_op()
        drive = b.master.slaves[TORQUE]
        seen["sizes"] = [len(drive.output), len(drive.input), len(analog.input)]
        samples = analog.sdo_read(0x6001, 0, 200, True)
        seen["samples"] = [samples[0], len(samples)]
        kp = struct.unpack("<H", drive.sdo_read(0x20D8, 0x0C))[0] * 0.1
        target = round(5.0 * 32768.0 / kp)
        statuswords = []
        for controlword in (0x00, 0x06, 0x07, 0x0F):
            drive.output = struct.pack("<Hhb", controlword, target, 10)
            b.exchanges(30)
            statuswords.append(struct.unpack_from("<H", drive.input)[0] & 0x6F)
        b.exchanges(300)
        _, raw, _, mode = struct.unpack("<Hhib", drive.input)
        seen["statuswords"], seen["mode"] = statuswords, mode
        seen["current"] = raw * kp / 8192.0
        first = struct.unpack_from("<Q", b.master.slaves[ENCODER].input, 2)[0]
        b.exchanges(100)
        seen["turned"] = struct.unpack_from("<Q", b.master.slaves[ENCODER].input, 2)[0] - first
        b.command("inject torque_drive drive_fault 0x2310")
        b.exchanges(20)
        seen["emergencies"] = emergencies(drive)
        seen["fault"] = struct.unpack_from("<H", drive.input)[0] & 0x4F
        return seen


def cyclic(seconds: float) -> dict[str, Any]:
    """Process data at 1 kHz: working counters and round trips."""
    with bench() as b:
        b.reach_op()
        b.be_patient()
        period, trips, counters = 0.001, [], {}
        begin = due = time.perf_counter()
        used = emulator_cpu(b.emulator.pid)
        while due < begin + seconds:
            due += period
            sent = time.perf_counter()
            counter = b.exchange()
            trips.append(time.perf_counter() - sent)
            counters[counter] = counters.get(counter, 0) + 1
            time.sleep(max(0.0, due - time.perf_counter()))
        share = (emulator_cpu(b.emulator.pid) - used) / (time.perf_counter() - begin)
        report = b.command("report")
        cuts = statistics.quantiles(trips, n=100)
        return {
            "counters": counters, "p50_us": 1e6 * cuts[49], "p99_us": 1e6 * cuts[98],
            "worst_us": 1e6 * max(trips), "cpu": share, "states": b.states(),
            "malformed": report["malformed"], "lost": report["lost"],
        }  # fmt: skip


def synchronous(_: float) -> dict[str, Any]:
    """SYNC0 of 1 ms, clocks by the master's own set-up, inputs and outputs at one address."""
    with bench() as b:
        master = b.master
        assert master.config_init() == len(LINE)
        drive = master.slaves[TORQUE]

        def configure(_: int) -> None:
            drive.sdo_write(0x1C32, 1, struct.pack("<H", 2))
            drive.sdo_write(0x10F1, 2, bytes(2))  # misses end nothing: this host is shared
            drive.dc_sync(True, 1_000_000)

        seen: dict[str, Any] = {"dc": master.config_dc()}
        drive.config_func = configure
        seen["image"] = master.config_overlap_map()
        assert master.state_check(pysoem.SAFEOP_STATE, 1_000_000) == pysoem.SAFEOP_STATE

        def exchange() -> int:
            master.send_overlap_processdata()
            return int(master.receive_processdata(ANSWER_US))

        b.exchange = exchange  # type: ignore[method-assign]
        b.request_op()
        statuswords = []
        for controlword in (0x00, 0x06, 0x07, 0x0F):
            drive.output = struct.pack("<Hhbx", controlword, 0, 10)
            b.exchanges(60)
            statuswords.append(struct.unpack_from("<H", drive.input)[0] & 0x6F)
        seen["statuswords"] = statuswords
        before, begin = master.dc_time, time.monotonic()
        seen["counters"] = sorted(set(b.exchanges(500)))
        seen["dc_rate"] = (master.dc_time - before) * 1.0e-9 / (time.monotonic() - begin)
        seen["missed"] = struct.unpack("<H", drive.sdo_read(0x1C32, 0x0B))[0]
        seen["states"] = b.states()
        return seen


def emulator_cpu(pid: int) -> float:
    """Processor time of a process, s."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def brought_back(b: Bench) -> bool:
    """Ask every slave that is not in OP for it; on a busy host pysoem may lose a request."""
    if set(b.states()) == {pysoem.OP_STATE}:
        return True
    for slave in b.master.slaves:
        if slave.state & pysoem.STATE_ERROR:
            slave.state = (slave.state & 0xF) + pysoem.STATE_ACK
            slave.write_state()
        elif slave.state != pysoem.OP_STATE:
            slave.state = min(2 * slave.state, pysoem.OP_STATE) or pysoem.INIT_STATE
            slave.write_state()
    return False


def faults(_: float) -> dict[str, Any]:
    """Unplugging and recovery, a short counter, an AL error, no frames, frames that come twice."""
    with bench() as b:
        b.reach_op()
        b.be_patient()
        master, seen = b.master, {}
        b.command("inject position_drive unplugged")
        seen["unplugged"] = b.exchanges(5)[-1]
        b.command("clear position_drive unplugged")
        seen["replugged"] = b.exchanges(5)[-1]
        seen["lost"] = [n for n, state in enumerate(b.states()) if state != pysoem.OP_STATE]
        for number in seen["lost"]:
            slave = master.slaves[number]
            slave.is_lost = True
            if slave.recover(10_000):
                slave.is_lost = False
            slave.reconfig(10_000)
            b.exchange()
        b.until(lambda: b.exchange() == COUNTER)
        b.until(lambda: brought_back(b), 20.0)
        seen["recovered"] = b.exchanges(5)
        b.command("inject torque_drive wkc_short_once 2")
        seen["short"] = b.exchanges(6)
        b.command("inject torque_drive al_error 0x2D")
        b.exchange()
        seen["al_error"] = [b.states()[TORQUE], master.slaves[TORQUE].al_status]
        b.command("inject link disconnect")
        seen["no_frame"] = b.exchange()
        b.command("clear link disconnect")
        b.command("inject link duplicate")
        seen["duplicates"] = b.exchanges(20)[-1]
        b.command("clear link duplicate")
        return seen


def silence(_: float) -> dict[str, Any]:
    """The watchdog without frames, the way back, emergencies, a mailbox without answers."""
    with bench() as b:
        b.reach_op()
        master, seen = b.master, {}
        drive = master.slaves[TORQUE]
        for slave in master.slaves[1:3]:
            set_watchdog(slave, 20.0)
        b.exchanges(10)
        time.sleep(0.3)
        seen["watchdog"] = [[state, each.al_status] for state, each in b.slave_states()]
        for slave in master.slaves:
            if slave.state & 0x10:
                slave.state = pysoem.SAFEOP_STATE + 0x10
                slave.write_state()
        b.exchanges(3)
        for slave in master.slaves:
            slave.state = pysoem.OP_STATE
            slave.write_state()
        b.until(lambda: set(b.states()) == {pysoem.OP_STATE})
        seen["again"] = b.exchanges(5)[-1]
        b.command("inject torque_drive emergency 0xFF07")
        seen["emergencies"] = emergencies(drive)
        b.command("inject torque_drive mailbox_silent")
        master.sdo_read_timeout = 50_000
        try:
            drive.sdo_read(0x1018, 1)
        except (pysoem.MailboxError, pysoem.WkcError, pysoem.PacketError) as error:
            seen["mailbox"] = type(error).__name__
        return seen


def wrong_line(_: float) -> dict[str, Any]:
    """Another device at a place, two places changed, a damaged EEPROM, a cut cable."""
    seen: dict[str, Any] = {}
    with bench() as b:
        b.command("inject torque_drive wrong_identity 0x99")
        b.command("inject segment order_swapped 3")
        b.master.config_init()
        seen["identity"] = [*map(identity, b.master.slaves)]
        b.command("clear torque_drive wrong_identity")
        b.command("clear segment order_swapped")
        b.command("inject encoder eeprom_damaged")
        b.command("inject encoder brown_out")
        b.command("inject digital_out cable_cut")
        seen["cut"] = b.master.config_init()
        b.command("clear digital_out cable_cut")
        seen["whole"] = b.master.config_init()
        seen["damaged"] = b.master.slaves[ENCODER].man
        seen["states"] = b.states()
        return seen


def captured(_: float) -> dict[str, Any]:
    """A short run with a capture; the file's path is the third argument."""
    with bench(sys.argv[3]) as b:
        b.reach_op()
        b.master.slaves[TORQUE].output = struct.pack("<Hhbx", 0x0006, 0x1234, 10)
        b.exchanges(20)
        b.master.slaves[TORQUE].sdo_read(0x1018, 1)
        b.command("inject torque_drive emergency 0xFF07")
        b.exchanges(2)
        seen = {"emergencies": emergencies(b.master.slaves[TORQUE])}
        with suppress(pysoem.SdoError):
            b.master.slaves[TORQUE].sdo_write(0x1018, 1, bytes(4))
        return {**seen, "input": b.master.slaves[TORQUE].input.hex()}


SCENARIOS = (start, remap, cyclic, faults, silence, wrong_line, captured, synchronous)

if __name__ == "__main__":
    scenario = {each.__name__: each for each in SCENARIOS}[sys.argv[1]]
    print(json.dumps(scenario(float(sys.argv[2]) if len(sys.argv) > 2 else 0.0)))
