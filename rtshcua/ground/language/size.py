"""How large a file may be; apart, so that whoever asks only for that imports no model."""

MAX_SIZE = 8 << 20  # bytes or characters of one file
