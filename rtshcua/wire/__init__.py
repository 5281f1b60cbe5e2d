"""What crosses a wire: canonical bytes, digests, keys by duty, signed envelopes, and the root that names the keys."""
