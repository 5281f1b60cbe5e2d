"""The compiler pipeline: imports, checks, proofs, lowering, the test suite, pins and signing."""
