"""From checked sources to the flat form: `program.compile_program` is the way in."""
