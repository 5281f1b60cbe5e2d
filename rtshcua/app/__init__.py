"""The services behind every front end: a typed request in, a typed result or a `Refusal` out, and no terminal."""
