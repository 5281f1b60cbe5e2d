"""Evidence (design section 6): records, their hash chain and Merkle tree, the signed close, and log verification.
Pure.
"""
