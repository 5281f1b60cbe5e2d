"""What `rtshcua test` is made of: running tests, telling what they found, and generating them."""
