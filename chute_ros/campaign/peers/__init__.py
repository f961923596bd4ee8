"""What people use today instead of this product, to be compared with it: one file a peer, written
from its documentation and with the constants of its source, in our own words."""
