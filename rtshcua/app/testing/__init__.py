"""The service `test`: runs tests and flies scenarios of sources, counts what they cover, and generates tests."""
