"""Section 6 of the design: records, their chain and Merkle tree, the signed close, and how a log is verified. Pure."""
