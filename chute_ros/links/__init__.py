"""How devices are spoken to: one folder a kind of link; api.py says what a link is."""
