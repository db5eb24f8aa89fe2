"""EtherCAT process data in the tick, and the set-up of its segment.

EtherCAT is a registered trade mark and patented technology, licensed by Beckhoff Automation GmbH.
"""
