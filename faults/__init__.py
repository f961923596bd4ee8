"""Faults that need a whole machine: networks that are cut, processes that are killed.

Not part of the product; run by make hosts, as root, each with its own network namespaces.
"""
