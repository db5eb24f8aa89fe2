"""An emulated EtherCAT segment, for tests only: no conformance is claimed.

EtherCAT is a registered trade mark and patented technology, licensed by Beckhoff Automation GmbH.
"""
