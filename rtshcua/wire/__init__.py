"""The wire formats: canonical bytes, digests, keys by duty, signed envelopes, and the trust root that names the
keys.
"""
