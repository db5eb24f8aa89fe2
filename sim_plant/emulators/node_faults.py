"""Faults of the CAN side of an emulated node."""

from __future__ import annotations

from sim_plant.emulators.fault_list import UP_TO_A_MINUTE, Fault

NODE_FAULTS = (
    Fault("node_reset", "resets spontaneously, as after a brown-out: boot-up, defaults", once=True),
    Fault("powered_off", "neither sends nor receives, power is off; boots when the fault ends"),
    Fault("silent", "sends neither heartbeat nor PDO nor EMCY; still answers SDO"),
    Fault("heartbeat_lost", "sends no heartbeat"),
    Fault("pdo_lost", "sends no PDO"),
    Fault("sdo_lost", "answers no SDO"),
    Fault(
        "bus_off",
        "its controller is off the bus: neither sends nor receives, and reports it afterwards",
    ),
    Fault("tpdo_length", "its TPDOs are too short", "octets missing", 1.0),
    Fault("tpdo_delay", "its TPDOs are late after SYNC", "delay, s", 0.002, limits=UP_TO_A_MINUTE),
    Fault("babble", "sends frames that mean nothing with a high priority", "frames/s", 2000.0),
)
