"""How every layer speaks to a person: spans, stable codes, diagnostics, exit codes. Below everything else."""
