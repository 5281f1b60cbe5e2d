"""How large a file may be; apart, so that whoever asks only for that imports no model."""

MAX_SIZE = 8 << 20  # bytes or characters of one file
MAX_TOKENS = 500_000  # words, numbers, texts and marks of one file: above 100,000 lines as people write them
MAX_FILES = 4_096  # of one program
