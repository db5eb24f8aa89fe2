"""Faults of the bus side of one emulated slave; its device has its own."""

from __future__ import annotations

from sim_plant.emulators.fault_list import SIGNED, Fault

SLAVE_FAULTS = (
    Fault("unplugged", "no power: it and all behind it vanish; in INIT when the fault ends"),
    Fault("brown_out", "loses its power for a moment: INIT, no station address", once=True),
    Fault("cable_cut", "the cable behind it is cut: the slaves behind it are out of reach"),
    Fault("wrong_identity", "another device is at its place", "product code", 0xBAD),
    Fault("wkc_short", "its process data passes without being read or counted"),
    Fault("wkc_short_once", "the same for some frames", "frames", 1.0, once=True),
    Fault("inputs_frozen", "its inputs keep their value, the working counter is right"),
    Fault("al_error", "falls to SAFEOP with an error", "AL status code", 0x001D, once=True),
    Fault("al_refusal", "refuses every step to a higher state", "AL status code", 0x001D),
    Fault("watchdog", "its process-data watchdog expires", once=True),
    Fault("emergency", "sends an emergency that does not last", "code", 0xFF01, once=True),
    Fault("mailbox_silent", "takes boxes and answers none"),
    Fault("dc_drift", "its clock runs fast", "ppm", 100.0, limits=SIGNED),
    Fault("dc_jump", "its clock jumps", "ns", 1.0e6, once=True, limits=SIGNED),
    Fault("sync0_lost", "its SYNC unit gives no pulses"),
    Fault("eeprom_damaged", "its EEPROM reads as erased; it stays in INIT at the next start"),
)
