"""Devices of the segment that are no drives: coupler, digital and analog terminals, encoder.

They are written from what such terminals do in general; identity and objects are invented.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from sim_plant.emulators.device_objects import (
    BOOLEAN,
    INT32,
    UINT8,
    UINT16,
    UINT32,
    UINT64,
    ObjectEntry,
)
from sim_plant.emulators.ethercat import process_data
from sim_plant.emulators.ethercat.process_data import (
    RX_ASSIGNMENT,
    TX_ASSIGNMENT,
    assignment_objects,
    mapping_entry,
    mapping_objects,
)
from sim_plant.emulators.fault_list import SIGNED, Fault
from sim_plant.emulators.object_device import ObjectDevice
from sim_plant.emulators.shared_simulation import SharedSimulation
from sim_plant.units import Second, Volt

Shared = SharedSimulation[Any, Any]
Clock = Callable[[], Second]
CHANNEL_STEP = 0x10  # from the objects of one channel to those of the next
INPUT, OUTPUT, SETTING = 0x6000, 0x7000, 0x8000  # first objects


def coupler(world: Shared, clock: Clock) -> ObjectDevice:
    """Return the device of a coupler, which has no process data."""
    return ObjectDevice((), world, clock)


def _channel_bits(first: int, channels: int, assignment: int) -> Iterator[ObjectEntry]:
    """Yield one BOOL a channel, each in a PDO of its own."""
    base = process_data.TX_MAPPING if assignment == TX_ASSIGNMENT else process_data.RX_MAPPING
    is_output = assignment == RX_ASSIGNMENT
    mappings = {}
    for number in range(channels):
        index = first + CHANNEL_STEP * number
        name = f"channel {number + 1}"
        yield ObjectEntry((index, 1), name, name, BOOLEAN, 0, is_output, True)
        mappings[base + number] = (mapping_entry(index, 1, 1),)
    yield from mapping_objects(mappings)
    yield from assignment_objects(assignment, tuple(mappings))


class DigitalInput(ObjectDevice):
    """Digital inputs; channel 1 is bit 0."""

    def __init__(self, channels: int, read: Callable[[], int], world: Shared, clock: Clock) -> None:
        super().__init__(_channel_bits(INPUT, channels, TX_ASSIGNMENT), world, clock)
        self._channels = channels
        self._read = read

    def step(self, now: Second, elapsed: Second) -> None:
        """Read the inputs."""
        bits = self._read()
        for number in range(self._channels):
            self.objects.put(INPUT + CHANNEL_STEP * number, bits >> number & 1, 1)


class DigitalOutput(ObjectDevice):
    """Digital outputs; they fall when the master is lost."""

    def __init__(
        self, channels: int, write: Callable[[int], None], world: Shared, clock: Clock
    ) -> None:
        super().__init__(_channel_bits(OUTPUT, channels, RX_ASSIGNMENT), world, clock)
        self._indices = [OUTPUT + CHANNEL_STEP * number for number in range(channels)]
        self._write = write

    def apply_outputs(self) -> None:
        """Set the outputs."""
        get = self.objects.get
        self._write(sum(get(index, 1) << n for n, index in enumerate(self._indices)))

    def on_master_lost(self, code: int) -> None:
        """Switch all outputs off."""
        for index in self._indices:
            self.objects.put(index, 0, 1)
        self._write(0)

    def on_restart(self, ready_at: Second) -> None:
        """Switch all outputs off."""
        self.on_master_lost(0)


OVERSAMPLING = (1, 2, 4, 5, 8, 10, 16, 20)  # samples in a cycle, a TxPDO each
STATUS_PDO, SAMPLES_PDO = 0x1A00, 0x1A10
SAMPLES = INPUT + 1  # object of the samples
FULL_SCALE = (1 << 23) - 1  # raw at the end of the range
UNDER_RANGE, OVER_RANGE, ANALOG_ERROR = 0x01, 0x02, 0x40  # status

ANALOG_FAULTS = (Fault("broken_wire", "reads its positive end and reports an error"),)


def _analog_objects() -> Iterator[ObjectEntry]:
    most = OVERSAMPLING[-1]
    yield ObjectEntry((INPUT, 0), "analog status", "number of entries", UINT8, 2)
    yield ObjectEntry((INPUT, 1), "analog status", "status", UINT16, 0, False, True)
    yield ObjectEntry((INPUT, 2), "analog status", "cycle counter", UINT16, 0, False, True)
    yield ObjectEntry((SAMPLES, 0), "samples", "number of entries", UINT8, most)
    for sub in range(1, most + 1):
        yield ObjectEntry((SAMPLES, sub), "samples", f"sample {sub}", INT32, 0, False, True)
    yield ObjectEntry((SETTING, 0), "settings", "number of entries", UINT8, 1)
    yield ObjectEntry(
        (SETTING, 1), "settings", "range, mV", UINT32, 10_000, True, False, 100, 30_000
    )
    mappings = {STATUS_PDO: tuple(mapping_entry(INPUT, sub, 16) for sub in (1, 2))}
    for number, count in enumerate(OVERSAMPLING):
        samples = tuple(mapping_entry(SAMPLES, sub, 32) for sub in range(1, count + 1))
        mappings[SAMPLES_PDO + number] = samples
    yield from mapping_objects(mappings)
    yield from assignment_objects(RX_ASSIGNMENT, (), slots=1)
    yield from assignment_objects(TX_ASSIGNMENT, (STATUS_PDO, SAMPLES_PDO), slots=2)


class OversamplingInput(ObjectDevice):
    """An analog input that delivers n samples a cycle, spread evenly over the last cycle."""

    def __init__(
        self,
        entries: Sequence[ObjectEntry],
        read: Callable[[Second], Volt],
        world: Shared,
        clock: Clock,
    ) -> None:
        """`entries`: those of a CoE slave; `read` returns the voltage at a time of the clock."""
        super().__init__([*entries, *_analog_objects()], world, clock)
        self.fault_list.add(*ANALOG_FAULTS)
        self._read = read

    def samples_per_cycle(self) -> int:
        """Return the number of samples that the assigned PDOs carry."""
        assigned = [self.objects.get(TX_ASSIGNMENT, sub) for sub in (1, 2)]
        counts = [
            OVERSAMPLING[pdo - SAMPLES_PDO]
            for pdo in assigned[: self.objects.get(TX_ASSIGNMENT)]
            if 0 <= pdo - SAMPLES_PDO < len(OVERSAMPLING)
        ]
        return max(counts, default=1)

    def step(self, now: Second, elapsed: Second) -> None:
        """Take the samples of the cycle that ends now; its length is that of 0x1C32:02."""
        put, count = self.objects.put, self.samples_per_cycle()
        cycle = 1.0e-9 * self.objects.get(0x1C32, 2)
        scale = 1000.0 * FULL_SCALE / self.objects.get(SETTING, 1)
        status = 0
        for sub in range(1, count + 1):
            raw = round(scale * self._read(now - cycle * (count - sub) / count))
            if "broken_wire" in self.active:
                raw, status = FULL_SCALE, status | ANALOG_ERROR
            if raw >= FULL_SCALE:
                status |= OVER_RANGE
            elif raw <= -FULL_SCALE:
                status |= UNDER_RANGE
            put(SAMPLES, max(-FULL_SCALE, min(FULL_SCALE, raw)), sub)
        put(INPUT, status, 1)
        put(INPUT, self.objects.get(INPUT, 2) + 1, 2)


ENCODER_ERROR, ENCODER_READY = 0x02, 0x04  # status
POSITION_SUB, STATUS_SUB = 0x11, 0x01
BITS_SUB, RATE_SUB = 0x11, 0x12

ENCODER_FAULTS = (
    Fault("encoder_lost", "no answer of the encoder: error, the position keeps its value"),
    Fault("encoder_jump", "the position is shifted at once", "increments", 4096.0, limits=SIGNED),
)


class EncoderSettings(NamedTuple):
    """Defaults of one channel."""

    bits: int = 32  # of the position
    rate: int = 1000  # kHz, of the serial interface


DEFAULT_ENCODER = EncoderSettings()


def _encoder_objects(channels: int, settings: EncoderSettings) -> Iterator[ObjectEntry]:
    mappings = {}
    for number in range(channels):
        index = INPUT + CHANNEL_STEP * number
        name = f"encoder {number + 1}"
        yield ObjectEntry((index, 0), name, "number of entries", UINT8, POSITION_SUB)
        yield ObjectEntry((index, STATUS_SUB), name, "status", UINT16, 0, False, True)
        yield ObjectEntry((index, POSITION_SUB), name, "position", UINT64, 0, False, True)
        at = SETTING + CHANNEL_STEP * number
        name = f"settings {number + 1}"
        yield ObjectEntry((at, 0), name, "number of entries", UINT8, RATE_SUB)
        yield ObjectEntry((at, BITS_SUB), name, "bits", UINT8, settings.bits, True, False, 1, 64)
        yield ObjectEntry((at, RATE_SUB), name, "clock, kHz", UINT16, settings.rate, True)
        mappings[process_data.TX_MAPPING + number] = (
            mapping_entry(index, STATUS_SUB, 16),
            mapping_entry(index, POSITION_SUB, 64),
        )
    yield from mapping_objects(mappings)
    yield from assignment_objects(RX_ASSIGNMENT, (), slots=1)
    yield from assignment_objects(TX_ASSIGNMENT, tuple(mappings), slots=channels)


class AbsoluteEncoder(ObjectDevice):
    """A terminal for absolute encoders: a 64-bit position and a status each."""

    def __init__(
        self,
        entries: Sequence[ObjectEntry],
        reads: Sequence[Callable[[], int]],
        world: Shared,
        clock: Clock,
        settings: EncoderSettings = DEFAULT_ENCODER,
    ) -> None:
        """`entries`: those of a CoE slave; `reads` return the increments of each channel."""
        super().__init__([*entries, *_encoder_objects(len(reads), settings)], world, clock)
        self.fault_list.add(*ENCODER_FAULTS)
        self._reads = reads

    def step(self, now: Second, elapsed: Second) -> None:
        """Read the positions, each modulo the number of its bits."""
        lost = "encoder_lost" in self.active
        jump = int(self.active.get("encoder_jump", 0.0))
        for number, read in enumerate(self._reads):
            index = INPUT + CHANNEL_STEP * number
            self.objects.put(index, ENCODER_ERROR if lost else ENCODER_READY, STATUS_SUB)
            if not lost:
                bits = self.objects.get(SETTING + CHANNEL_STEP * number, BITS_SUB)
                self.objects.put(index, read() + jump & (1 << bits) - 1, POSITION_SUB)
